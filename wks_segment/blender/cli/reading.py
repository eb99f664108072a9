"""Read the files that a command is given: poses of characters, and models to choose from."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import bpy

from ...core.message import Message, message_of
from ..errors import UserError
from ..scene import file_formats
from ..scene import poses as reader
from ..scene.characters import Character, armature_of, group, mesh_objects, quoted
from ..scene.missing_files import missing_files
from ..scene.pose_library import read_actions
from ..scene.poses import Pose
from ..workflow import model_library
from ..workflow.model_ranking import NamedModel, models_in_files
from ..workflow.report import Report, shape_warnings


def read_poses(options: argparse.Namespace, report: Report) -> list[Pose]:
    """Poses of all characters in all files of the options; warns of what is wrong with them before they are used."""
    poses: list[Pose] = []
    with report.stage("read"):
        opened = file_formats.open_files(options.files)
        missing = missing_files()
        try:
            for path, objects in zip(options.files, opened, strict=True):
                poses += _poses_in(path, objects, options, report)
        except UserError as error:
            if not missing:
                raise
            template = "{reason}; files that it needs are missing: {names}"
            raise UserError(template, reason=message_of(error), names=", ".join(missing)) from error
    report.poses = poses
    if missing:
        template = "Files that this one needs are missing, and what is in them is left out: {names}"
        warn_at_once(report, Message(template, names=", ".join(missing)))
    warn_at_once(report, *shape_warnings(poses))
    return poses


def warn_at_once(report: Report, *warnings: str) -> None:
    """Add warnings to a report, and print them on standard error before a long computation."""
    for warning in warnings:
        print(f"warning: {warning}", file=sys.stderr, flush=True)
    report.warn(*warnings)


def _poses_in(path: Path, objects: list[bpy.types.Object], options: argparse.Namespace, report: Report) -> list[Pose]:
    """Poses of the characters in a file."""
    characters = characters_in(path, objects, options.object)
    set_action(characters, options.action)
    if options.shape_keys is not None:
        without = [character for character in characters if not reader.shape_key_names(character)]
        if without and len(without) < len(characters):
            names = quoted(character.name for character in without)
            warn_at_once(report, Message("{names} has no shape keys and is left out", names=names))
            characters = [character for character in characters if character not in without]
    return [pose for character in characters for pose in _poses_of(character, options)]


def _poses_of(character: Character, options: argparse.Namespace) -> list[Pose]:
    if options.shape_keys is not None:
        return reader.read_shape_keys(bpy.context, character, options.shape_keys)
    if options.markers is not None:
        return reader.read_markers(bpy.context, character, options.markers)
    if options.actions is not None:
        return read_actions(bpy.context, character, options.actions)
    if options.frames is None:
        return reader.read_objects(bpy.context, [character])
    first, last, count = options.frames
    if first is None or last is None:
        frames = reader.own_frames(bpy.context.scene, character, count)
    else:
        frames = reader.evenly(first, last, count)
    return reader.read_frames(bpy.context, character, frames)


def characters_in(path: Path, objects: list[bpy.types.Object], names: Sequence[str] | None) -> list[Character]:
    """Characters of a file: any number in a .blend file, one in a file of another format.

    Parameters
    ----------
    path
    objects
        All objects of the file.
    names : optional
        Names of objects, if only these are used.

    Raises
    ------
    UserError
        If there is no mesh, or no object of a name.
    """
    meshes = mesh_objects(objects)
    # Blender does not evaluate other objects: they would have no modifiers, and one shape in all frames.
    evaluated = [obj for obj in meshes if obj.name in bpy.context.view_layer.objects and not obj.hide_viewport]
    if meshes and not evaluated:
        raise UserError(
            "{path}: all mesh objects in it are disabled in viewports, or their collections are excluded", path=path
        )
    if names:
        missing = set(names) - {obj.name for obj in evaluated}
        if missing:
            raise UserError(
                "{path}: there is no mesh object named {names}", path=path, names=", ".join(sorted(missing))
            )
        evaluated = [obj for obj in evaluated if obj.name in names]
    if not evaluated:
        raise UserError("{path}: there is no mesh in this file", path=path)
    return group(evaluated, together=path.suffix.lower() != ".blend")


def set_action(characters: Sequence[Character], name: str | None) -> None:
    """Assign the action of a name, if one is given, to the armature of each object, or to the object without one."""
    if name is None:
        return
    action = bpy.data.actions.get(name)
    if action is None:
        names = ", ".join(other.name for other in bpy.data.actions) or "none"
        raise UserError('There is no action named "{name}"; the file has: {names}', name=name, names=names)
    for character in characters:
        for owner in {armature_of(obj) or obj for obj in character.objects}:
            data = owner.animation_data_create()
            data.action = action
            # From Blender 4.4 on an action has slots; one with another name is not assigned automatically.
            if getattr(data, "action_slot", action) is None:
                if not data.action_suitable_slots:
                    raise UserError('The action "{name}" does not fit "{owner}"', name=name, owner=owner.name)
                data.action_slot = data.action_suitable_slots[0]


def read_models(folder: Path, report: Report) -> list[NamedModel]:
    """The models in a folder; UserError if there is none."""
    if not folder.is_dir():
        raise UserError("{folder}: there is no such folder", folder=folder)
    models = models_in_files(model_library.in_folder(folder), report)
    if not models:
        raise UserError("{folder}: there is no model in this folder that can be used", folder=folder)
    return models
