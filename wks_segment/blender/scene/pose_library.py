"""Reads the poses of a pose library: pose assets, or else actions, that move the bones of a character's armature."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import bpy

from ..errors import UserError
from .actions import armature_with_bones, moved_by
from .characters import Character
from .kept_pose import kept_pose, to_rest
from .poses import Pose, evenly, read_pose, with_rest


def read_actions(context: bpy.types.Context, character: Character, count: int) -> list[Pose]:
    """A character in at most `count` poses of its library, evenly chosen; each pose starts from the rest position.

    A pose asset is one pose; of another action, the pose at the middle frame is read. Afterward the armature has its
    pose from before.

    Raises
    ------
    UserError
        If the character has no armature, or no action in the file moves a bone of it.
    """
    armature = armature_with_bones(character)
    if armature is None:
        raise UserError(
            '"{name}" has no armature that a pose could move: take poses from elsewhere', name=character.name
        )
    actions = [action for action in bpy.data.actions if moved_by(action, armature) & set(armature.pose.bones.keys())]
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
            to_rest(armature)
            first, last = action.frame_range
            frame = first if action.asset_data is not None else (first + last) / 2
            armature.pose.apply_pose_from_action(action, evaluation_time=frame)
            context.view_layer.update()
            poses.append(read_pose(context, character, f"{character.name}, {action.name}"))
    return with_rest(context, poses)


@contextmanager
def _posable(context: bpy.types.Context, armature: bpy.types.Object) -> Iterator[None]:
    """Turn the animation of an armature off for a while, and restore its pose with all that has no keyframes."""
    data = armature.animation_data
    if data is not None and data.use_tweak_mode:
        raise UserError(
            '"{name}" is in tweak mode: leave it first (Tab in the Nonlinear Animation editor)', name=armature.name
        )
    with kept_pose(context, armature):
        if data is not None:
            data.action, data.use_nla = None, False
        yield
