"""Read the files that a command is given: poses of characters, and models to choose from."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import bpy

from ...core.message import Message
from ..errors import UserError
from ..scene import file_formats
from ..scene import poses as reader
from ..scene.actions import assign_action
from ..scene.animation import Choice, animated
from ..scene.characters import Character, armature_of, evaluated_objects, group, mesh_objects, quoted
from ..scene.pose_library import read_actions
from ..scene.poses import Pose
from ..scene.simulations import check_simulations
from ..scene.touching import joined
from ..workflow import model_library
from ..workflow.model_ranking import NamedModel, models_in_files
from ..workflow.report import Report


def read_poses(
    options: argparse.Namespace, report: Report, *, single: bool = True, writes: bool = True
) -> list[Pose]:  # fmt: skip
    """Poses of the characters in all files of the options.

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
    over_time = options.frames is not None or options.markers is not None
    with report.stage("read"):
        for path, objects in zip(options.files, file_formats.open_files(options.files), strict=True):
            characters = characters_in(path, objects, options.object, report)
            if writes or over_time:
                check_simulations(bpy.context.scene, characters, over_time)
            set_action(characters, options.action)
            if options.object and path.suffix.lower() != ".blend":
                characters = group([obj for character in characters for obj in character.objects], together=True)
            if over_time:
                poses += _animated_poses(path, characters, options, report, single)
                continue
            if path.suffix.lower() != ".blend":
                characters = group([obj for character in characters for obj in character.objects], together=True)
            else:
                characters, notes = joined(bpy.context, characters)
                report.choices += notes
            for character in characters:
                poses += _poses_of(character, options)
    report.poses = poses
    return poses


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
                context, character, frames_of(character), list(markers.values()) or None, report.warnings
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


def characters_in(
    path: Path, objects: list[bpy.types.Object], names: Sequence[str] | None, report: Report
) -> list[Character]:
    """Characters of a file, in the scene that has them.

    Parameters
    ----------
    path
    objects
        All objects of the file.
    names : optional
        Names of objects, if only these are used.
    report : Report
        Told of a scene that was opened, and of objects that are disabled.

    Raises
    ------
    UserError
        If there is no mesh, or no object of a name.
    """
    if path.suffix.lower() == ".blend" and set(objects) == set(bpy.context.scene.objects):
        objects = _scene_with_meshes(path, names, report)
    meshes = [obj for obj in mesh_objects(objects) if not names or obj.name in names]
    missing = set(names or ()) - {obj.name for obj in meshes}
    if missing:
        raise UserError("{path}: there is no mesh object named {names}", path=path, names=", ".join(sorted(missing)))
    if not meshes:
        raise UserError("{path}: there is no mesh in this file", path=path)
    evaluated = evaluated_objects(bpy.context.view_layer)
    disabled = [obj.name for obj in meshes if obj not in evaluated]
    if len(disabled) == len(meshes):
        raise UserError(
            "{path}: all mesh objects in it are disabled in viewports, or their collections are disabled or excluded: "
            "{names}",
            path=path, names=quoted(disabled),
        )  # fmt: skip
    if names and disabled:
        raise UserError(
            "{path}: {names} is disabled in viewports, or its collection is disabled or excluded",
            path=path, names=quoted(disabled),
        )  # fmt: skip
    if disabled:
        report.choices.append(Message("Left out, disabled in viewports: {names}", names=quoted(disabled)))
    return group([obj for obj in meshes if obj in evaluated])


def _scene_with_meshes(path: Path, names: Sequence[str] | None, report: Report) -> list[bpy.types.Object]:
    """The objects of the open scene, or of the only other one with mesh objects (of these names), which is opened.

    Raises
    ------
    UserError
        If several other scenes have some.
    """

    def has_meshes(scene: bpy.types.Scene) -> bool:
        return any(not names or obj.name in names for obj in mesh_objects(scene.objects))

    scene = bpy.context.scene
    others = [other for other in bpy.data.scenes if other != scene and has_meshes(other)]
    if has_meshes(scene) or not others:
        return list(scene.objects)
    if len(others) > 1:
        raise UserError(
            '{path}: the open scene "{scene}" has no such mesh, but {others} have: save the file with the right one '
            "open",
            path=path, scene=scene.name, others=quoted(other.name for other in others),
        )  # fmt: skip
    bpy.context.window.scene = others[0]
    bpy.context.view_layer.update()
    report.choices.append(Message('Taken from the scene "{scene}"', scene=others[0].name))
    return list(others[0].objects)


def set_action(characters: Sequence[Character], name: str | None) -> None:
    """Assign the action of a name, if one is given, to the armature of each object, or to the object without one."""
    if name is None:
        return
    action = bpy.data.actions.get(name)
    if action is None:
        names = ", ".join(other.name for other in bpy.data.actions) or "none"
        raise UserError('There is no action named "{name}"; the file has: {names}', name=name, names=names)
    for owner in dict.fromkeys(armature_of(obj) or obj for character in characters for obj in character.objects):
        assign_action(owner, action)


def read_models(folder: Path, report: Report) -> list[NamedModel]:
    """The models in a folder; UserError if there is none."""
    if not folder.is_dir():
        raise UserError("{folder}: there is no such folder", folder=folder)
    models = models_in_files(model_library.in_folder(folder), report)
    if not models:
        raise UserError("{folder}: there is no model in this folder that can be used", folder=folder)
    return models
