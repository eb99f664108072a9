"""Which characters of an opened file a command is about, by the objects, and with the action, that its options name."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import bpy

from ...core.message import Message
from ..errors import UserError
from ..scene.actions import assign_action, assign_take
from ..scene.characters import Character, armature_of, evaluated_objects, group, mesh_objects, quoted
from ..workflow.report import Report


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
    if assign_take(Character(tuple(obj for character in characters for obj in character.objects)), name):
        return
    action = bpy.data.actions.get(name)
    if action is None:
        names = ", ".join(other.name for other in bpy.data.actions) or "none"
        raise UserError('There is no action named "{name}"; the file has: {names}', name=name, names=names)
    for owner in dict.fromkeys(armature_of(obj) or obj for character in characters for obj in character.objects):
        assign_action(owner, action)
