"""Read the files that a command is given: poses of characters, and models to choose from."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import bpy

from ...core.message import Message, message_of
from ..errors import UserError
from ..scene import file_formats
from ..scene import poses as reader
from ..scene.animation import Choice, animated
from ..scene.characters import Character, group, quoted
from ..scene.missing_files import missing_files
from ..scene.pose_library import read_actions
from ..scene.poses import Pose
from ..scene.simulations import check_simulations
from ..scene.touching import joined
from ..workflow import model_library
from ..workflow.model_ranking import NamedModel, models_in_files
from ..workflow.report import Report, shape_warnings
from .file_characters import characters_in, set_action


def read_poses(
    options: argparse.Namespace, report: Report, *, single: bool = True, writes: bool = True
) -> list[Pose]:  # fmt: skip
    """Poses of the characters in all files of the options; warns of what is wrong with them before they are used.

    Parameters
    ----------
    options
    report : Report
        Told what was chosen and left out.
    single : bool
        Whether one of several characters that move is taken from each file, unless the options name objects.
    writes : bool
        Whether something will be written to the meshes, which a simulation would not survive.
    """
    poses: list[Pose] = []
    with report.stage("read"):
        opened = file_formats.open_files(options.files)
        missing = missing_files()
        try:
            for path, objects in zip(options.files, opened, strict=True):
                characters = characters_in(path, objects, options.object, report)
                if writes or _over_time(options):
                    check_simulations(bpy.context.scene, characters, _over_time(options))
                set_action(characters, options.action)
                poses += _poses_in(path, characters, options, report, single)
        except UserError as error:
            if not missing:
                raise
            template = "{reason}; files that it needs are missing: {names}"
            raise UserError(template, reason=message_of(error), names=", ".join(missing)) from error
    report.poses = poses
    if missing:
        template = "Files that this one needs are missing, and what is in them is left out: {names}"
        warn_at_once(report, Message(template, names=", ".join(missing)))
    warn_at_once(report, *report.left_out, *shape_warnings(poses))
    return poses


def warn_at_once(report: Report, *warnings: str) -> None:
    """Add warnings to a report, and print them on standard error before a long computation."""
    for warning in dict.fromkeys(warnings):
        if warning not in report.warnings:
            print(f"warning: {warning}", file=sys.stderr, flush=True)
    report.warn(*warnings)


def _over_time(options: argparse.Namespace) -> bool:
    """Whether the options ask for poses at several times of an animation."""
    return options.frames is not None or options.markers is not None


def _poses_in(
    path: Path, characters: list[Character], options: argparse.Namespace, report: Report, single: bool
) -> list[Pose]:
    """Poses of the characters in a file, of which objects are made one that belong together."""
    whole = path.suffix.lower() != ".blend"
    if options.object and whole:
        characters = group([obj for character in characters for obj in character.objects], together=True)
    if _over_time(options):
        return _animated_poses(path, characters, options, report, single)
    if whole:
        characters = group([obj for character in characters for obj in character.objects], together=True)
    else:
        characters, notes = joined(bpy.context, characters)
        report.choices += notes
    if options.shape_keys is not None:
        characters = _with_shape_keys(characters, report)
    return [pose for character in characters for pose in _poses_of(character, options)]


def _with_shape_keys(characters: list[Character], report: Report) -> list[Character]:
    """The characters that have shape keys, or all if none has; warns of those that are left out."""
    without = [character for character in characters if not reader.shape_key_names(character)]
    if not without or len(without) == len(characters):
        return characters
    names = quoted(character.name for character in without)
    warn_at_once(report, Message("{names} has no shape keys and is left out", names=names))
    return [character for character in characters if character not in without]


def _poses_of(character: Character, options: argparse.Namespace) -> list[Pose]:
    if options.shape_keys is not None:
        return reader.read_shape_keys(bpy.context, character, options.shape_keys)
    if options.actions is not None:
        return read_actions(bpy.context, character, options.actions)
    return reader.read_objects(bpy.context, [character])


def _animated_poses(
    path: Path, characters: list[Character], options: argparse.Namespace, report: Report, single: bool
) -> list[Pose]:
    """Poses at frames, or at markers, of the characters that move in a file."""
    context = bpy.context
    markers = {} if options.markers is None else reader.marked_frames(context.scene, options.markers)

    def frames_of(character: Character) -> list[int]:
        if options.frames is None:
            return list(markers)
        first, last, count = options.frames
        if first is None or last is None:
            return reader.own_frames(context.scene, character, count)
        return reader.evenly(first, last, count)

    with animated(context, characters, frames_of, choice_of(path, options, single=single)) as found:
        report.choices += found.notes
        return [
            pose
            for character in found.characters
            for pose in reader.read_frames(
                context, character, frames_of(character), list(markers.values()) or None, report.left_out
            )
        ]


def choice_of(path: Path, options: argparse.Namespace, single: bool = True) -> Choice:
    """How characters of a file are chosen; objects and an action that the options name are taken as they are."""
    return Choice(
        single=single and not options.object,
        drops=not options.object,
        together=path.suffix.lower() != ".blend",
        actions=options.action is None and options.frames is not None,
    )


def read_models(folder: Path, report: Report) -> list[NamedModel]:
    """The models in a folder; UserError if there is none."""
    if not folder.is_dir():
        raise UserError("{folder}: there is no such folder", folder=folder)
    models = models_in_files(model_library.in_folder(folder), report)
    if not models:
        raise UserError("{folder}: there is no model in this folder that can be used", folder=folder)
    return models
