"""Reads the poses of a pose library: pose assets, or else actions, that move the bones of a character's armature."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import bpy
from mathutils import Matrix

from ..errors import UserError
from .characters import Character, armature_of
from .poses import Pose, evenly, read_pose, with_rest

BONE = re.compile(r'pose\.bones\["((?:[^"\\]|\\.)*)"\]')
"""Matches the data path of an F-curve that moves a bone; the group is the name of the bone."""


def read_actions(context: bpy.types.Context, character: Character, count: int) -> list[Pose]:
    """A character in at most `count` poses of its library, evenly chosen; each pose starts from the rest position.

    A pose asset is one pose; of another action, the pose at the middle frame is read. Afterward the armature has its
    pose from before.

    Raises
    ------
    UserError
        If the character has no armature, or no action in the file moves a bone of it.
    """
    armature = next((rig for rig in map(armature_of, character.objects) if rig is not None), None)
    if armature is None:
        raise UserError(
            '"{name}" has no armature that a pose could move: take poses from elsewhere', name=character.name
        )
    actions = [action for action in bpy.data.actions if _bones(action) & set(armature.pose.bones.keys())]
    actions = [action for action in actions if action.asset_data is not None] or actions
    if not actions:
        raise UserError(
            'There is no pose for "{name}" in this file: create pose assets of it (Pose > Create Pose Asset), or take '
            "poses from elsewhere",
            name=armature.name,
        )
    poses = []
    with _posable(context, armature):
        for action in (actions[i] for i in evenly(0, len(actions) - 1, count)):
            for bone in armature.pose.bones:
                bone.matrix_basis = Matrix()
            first, last = action.frame_range
            frame = first if action.asset_data is not None else (first + last) / 2
            armature.pose.apply_pose_from_action(action, evaluation_time=frame)
            context.view_layer.update()
            poses.append(read_pose(context, character, f"{character.name}, {action.name}"))
    return with_rest(context, poses)


def _bones(action: bpy.types.Action) -> set[str]:
    """Names of the bones that an action moves."""
    if bpy.app.version < (4, 4, 0):
        curves = list(action.fcurves)
    else:
        bags = (bag for layer in action.layers for strip in layer.strips for bag in strip.channelbags)
        curves = [curve for bag in bags for curve in bag.fcurves]
    matches = (BONE.match(curve.data_path) for curve in curves)
    return {bpy.utils.unescape_identifier(match[1]) for match in matches if match is not None}


@contextmanager
def _posable(context: bpy.types.Context, armature: bpy.types.Object) -> Iterator[None]:
    """Turn the animation of an armature off for a while, and restore its pose with all that has no keyframes."""
    data = armature.animation_data
    if data is not None and data.use_tweak_mode:
        raise UserError(
            '"{name}" is in tweak mode: leave it first (Tab in the Nonlinear Animation editor)', name=armature.name
        )
    animation = {name: getattr(data, name, None) for name in ("action", "action_slot", "use_nla")} if data else {}
    before = [(bone, _bone_state(bone), dict(bone.items())) for bone in armature.pose.bones]
    try:
        if data is not None:
            data.action, data.use_nla = None, False
        yield
    finally:
        for name, value in animation.items():
            if value is not None:
                setattr(data, name, value)
        # Evaluate keyframes now, so that they do not overwrite what is restored next.
        context.view_layer.update()
        for bone, state, properties in before:
            for name, value in state.items():
                setattr(bone, name, value)
            for name, value in properties.items():
                bone[name] = value
        context.view_layer.update()


def _bone_state(bone: bpy.types.PoseBone) -> dict[str, Any]:
    """All properties of a bone that can be animated.

    The rotation mode is the first one to be restored, since Blender converts the other properties when it is set.
    """
    state: dict[str, Any] = {"rotation_mode": bone.rotation_mode}
    for prop in bone.bl_rna.properties:
        if prop.is_animatable and not prop.is_readonly and prop.type in ("FLOAT", "INT", "BOOLEAN"):
            value = getattr(bone, prop.identifier)
            state[prop.identifier] = tuple(value) if prop.is_array else value
    return {name: value for name, value in state.items() if not name.startswith("matrix")}
