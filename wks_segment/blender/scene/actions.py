"""The action that a character's poses are taken from, of several in the file."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager

import bpy

from ...core.message import Message
from ..errors import UserError
from .characters import Character, armature_of
from .kept_pose import Posable, kept_pose, parts_of, to_rest
from .motion import FramesOf, motions
from .simulations import must_not_change

MOVED = {
    bpy.types.Object: re.compile(r'pose\.bones\["((?:[^"\\]|\\.)*)"\]'),
    bpy.types.Key: re.compile(r'key_blocks\["((?:[^"\\]|\\.)*)"\]'),
}
"""Matches the data path of an F-curve that moves a bone or a shape key, by what has these; the group is the name."""
LEAST_SHARE_KNOWN = 0.5
"""An action is for an armature that has at least this share of its bones: all rigs share a few names, such as root."""
NAMED = 8
"""Most actions that a message names."""


def armature_with_bones(character: Character) -> bpy.types.Object | None:
    """The armature that moves a character, if there is one."""
    return next((rig for rig in map(armature_of, character.objects) if rig is not None), None)


def actions_for(owner: Posable) -> list[bpy.types.Action]:
    """The actions in this file that move bones of an armature, or shape keys, and do not belong to another one."""
    others = [other for other in (*bpy.data.objects, *bpy.data.shape_keys) if other != owner]
    taken = set().union(*map(_own_actions, others)) - _own_actions(owner)
    rigs = {other.name for other in others if isinstance(other, bpy.types.Object) and other.type == "ARMATURE"}
    parts = set(parts_of(owner).keys())
    found = []
    for action in bpy.data.actions:
        moved = moved_by(action, owner)
        # The importer of FBX names actions after the armature: "Fox|Run".
        is_free = action not in taken and action.name.partition("|")[0] not in rigs
        if (
            (is_free or action in _own_actions(owner))
            and moved
            and len(moved & parts) >= LEAST_SHARE_KNOWN * len(moved)
        ):
            found.append(action)
    return found


def _own_actions(owner: bpy.types.ID) -> set[bpy.types.Action]:
    """The actions that are assigned to something, or wait in its NLA tracks."""
    data = owner.animation_data
    if data is None:
        return set()
    strips = {strip.action for track in data.nla_tracks for strip in track.strips}
    return ({data.action} | strips) - {None}


def assign_action(owner: bpy.types.ID, action: bpy.types.Action) -> None:
    """Let an action move something; UserError if it is made for something else."""
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
    owner = armature_with_bones(character) or next(
        filter(None, (obj.data.shape_keys for obj in character.objects)), None
    )
    actions = [] if owner is None else actions_for(owner)
    own = None if owner is None else _action(owner)
    if owner is None or not set(actions) - {own} or not _may_act(context, character, owner):
        yield []
        return
    with kept_pose(context, owner) as kept:
        (motion,) = motions(context, [character], frames_of)
        bending: dict[bpy.types.Action | None, float] = {own: motion.bending}
        if not (keeps_moving and motion.is_bent):
            for action in actions:
                kept.restore(context)
                if action not in bending and _acts(owner, action):
                    bending[action] = motions(context, [character], frames_of)[0].bending
        best = max(bending, key=bending.__getitem__)  # the assigned one, if all are static
        kept.restore(context)
        if best != own:
            _acts(owner, best)
        yield [_note(character, best, [action for action in actions if action != best])]


def _note(character: Character, action: bpy.types.Action | None, others: list[bpy.types.Action]) -> Message:
    if action is not None and not others:
        return Message('"{name}": the poses are from the action "{action}"', name=character.name, action=action.name)
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


def _may_act(context: bpy.types.Context, character: Character, owner: Posable) -> bool:
    """Whether another action can be tried: not in tweak mode, not on linked data, and not if a simulation would lose
    its frames by that."""
    data = owner.animation_data
    is_free = owner.library is None and owner.override_library is None
    return is_free and not (data and data.use_tweak_mode) and not must_not_change(context.scene, character)


def _action(owner: bpy.types.ID) -> bpy.types.Action | None:
    return None if owner.animation_data is None else owner.animation_data.action


def _acts(owner: Posable, action: bpy.types.Action) -> bool:
    """Assign an action, alone, to an armature or shape keys at rest; False if it does not fit."""
    to_rest(owner)
    try:
        assign_action(owner, action)
    except UserError:
        return False
    owner.animation_data.use_nla = False
    return True


def moved_by(action: bpy.types.Action, owner: Posable) -> set[str]:
    """Names of the bones that an action moves, or of the shape keys if the owner has these."""
    if bpy.app.version < (4, 4, 0):
        curves = list(action.fcurves)
    else:
        bags = (bag for layer in action.layers for strip in layer.strips for bag in strip.channelbags)
        curves = [curve for bag in bags for curve in bag.fcurves]
    matches = (MOVED[type(owner)].match(curve.data_path) for curve in curves)
    return {bpy.utils.unescape_identifier(match[1]) for match in matches if match is not None}
