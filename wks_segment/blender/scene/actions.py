"""The action that a character's poses are taken from, of several in the file."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager

import bpy

from ...core.message import Message
from ..errors import UserError
from .characters import Character, armature_of
from .kept_pose import kept_pose, to_rest
from .motion import FramesOf, motions
from .simulations import must_not_change

BONE = re.compile(r'pose\.bones\["((?:[^"\\]|\\.)*)"\]')
"""Matches the data path of an F-curve that moves a bone; the group is the name of the bone."""
NAMED = 8
"""Most actions that a message names."""


def armature_with_bones(character: Character) -> bpy.types.Object | None:
    """The armature that moves a character, if there is one."""
    return next((rig for rig in map(armature_of, character.objects) if rig is not None), None)


def actions_for(armature: bpy.types.Object) -> list[bpy.types.Action]:
    """The actions in this file that move bones of an armature, and do not belong to another one."""
    others = [obj for obj in bpy.data.objects if obj.type == "ARMATURE" and obj != armature]
    taken = {obj.animation_data.action for obj in others if obj.animation_data is not None}
    own = _action(armature)
    bones = set(armature.pose.bones.keys())
    return [
        action for action in bpy.data.actions if action == own or (bones_of(action) & bones and action not in taken)
    ]


def assign_action(owner: bpy.types.Object, action: bpy.types.Action) -> None:
    """Let an action move an object; UserError if it is made for something else."""
    data = owner.animation_data_create()
    data.action = action
    # From Blender 4.4 on an action has slots; one with another name is not assigned automatically.
    if getattr(data, "action_slot", action) is None:
        if not data.action_suitable_slots:
            raise UserError('The action "{name}" does not fit "{owner}"', name=action.name, owner=owner.name)
        data.action_slot = data.action_suitable_slots[0]


@contextmanager
def acting(
    context: bpy.types.Context, character: Character, frames_of: FramesOf, keeps_moving: bool
) -> Iterator[list[Message]]:
    """Let the action with the most movement move a character for a while; yields what to tell of it.

    Parameters
    ----------
    context
    character
    frames_of
        Gives the frames to read, with the action that is assigned.
    keeps_moving : bool
        Whether the action that is assigned stays if the character moves by it, as the artist sees it.
    """
    armature = armature_with_bones(character)
    actions = [] if armature is None else actions_for(armature)
    own = None if armature is None else _action(armature)
    if armature is None or not set(actions) - {own} or not _may_act(context, character, armature):
        yield []
        return
    with kept_pose(context, armature) as kept:
        (motion,) = motions(context, [character], frames_of)
        bending: dict[bpy.types.Action | None, float] = {own: motion.bending}
        if not (keeps_moving and motion.is_bent):
            for action in actions:
                if action not in bending and _acts(armature, action):
                    bending[action] = motions(context, [character], frames_of)[0].bending
        best = max(bending, key=bending.__getitem__)  # the assigned one, if all are static
        if best != own:
            _acts(armature, best)
        elif len(bending) > 1:
            kept.restore(context)
        yield [_note(character, best, [action for action in actions if action != best])]


def _note(character: Character, action: bpy.types.Action | None, others: list[bpy.types.Action]) -> Message:
    names = ", ".join(f'"{other.name}"' for other in others[:NAMED]) + " …" * (len(others) > NAMED)
    if action is None:
        return Message(
            '"{name}": the poses are from its animation as it is; actions in this file: {others}',
            name=character.name, others=names,
        )  # fmt: skip
    return Message(
        '"{name}": the poses are from the action "{action}"; others: {others}',
        name=character.name, action=action.name, others=names,
    )  # fmt: skip


def _may_act(context: bpy.types.Context, character: Character, armature: bpy.types.Object) -> bool:
    """Whether another action can be tried: not in tweak mode, not on linked data, and not if a simulation would lose
    its frames by that."""
    data = armature.animation_data
    is_free = armature.library is None and armature.override_library is None
    return is_free and not (data and data.use_tweak_mode) and not must_not_change(context.scene, character)


def _action(owner: bpy.types.Object) -> bpy.types.Action | None:
    return None if owner.animation_data is None else owner.animation_data.action


def _acts(armature: bpy.types.Object, action: bpy.types.Action) -> bool:
    """Assign an action to an armature at rest, alone; False if it does not fit."""
    to_rest(armature)
    try:
        assign_action(armature, action)
    except UserError:
        return False
    armature.animation_data.use_nla = False
    return True


def bones_of(action: bpy.types.Action) -> set[str]:
    """Names of the bones that an action moves."""
    if bpy.app.version < (4, 4, 0):
        curves = list(action.fcurves)
    else:
        bags = (bag for layer in action.layers for strip in layer.strips for bag in strip.channelbags)
        curves = [curve for bag in bags for curve in bag.fcurves]
    matches = (BONE.match(curve.data_path) for curve in curves)
    return {bpy.utils.unescape_identifier(match[1]) for match in matches if match is not None}
