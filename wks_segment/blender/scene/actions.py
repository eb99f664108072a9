"""The action that a character's poses are taken from, of several in the file."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from typing import Any

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


@dataclass(frozen=True, eq=False)
class Take:
    """An animation of a character: an action, or what a file has under one name for several objects.

    Attributes
    ----------
    name : str
    actions
        Action of each armature, shape keys or object that it moves, and the slot if it is known.
    """

    name: str
    actions: Mapping[bpy.types.ID, tuple[bpy.types.Action, Any]]


def with_owner(character: Character) -> bool:
    """Whether a character has an armature or shape keys, whose actions can be chosen; else its objects have them."""
    return _owner(character) is not None


def assign_take(character: Character, name: str) -> bool:
    """Let the animation of this name move a character without armature; False if there is none."""
    take = next((take for take in _takes(character) if take.name == name), None)
    return take is not None and not with_owner(character) and _act(take, _owners(character))


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
    takes, owners = _takes(character), _owners(character)
    own = _assigned(takes, owners)
    can_choose = any(take is not own for take in takes)
    if not can_choose or not all(_may_act(context, character, owner) for owner in owners):
        yield []
        return
    with ExitStack() as stack:
        kept = [stack.enter_context(kept_pose(context, owner)) for owner in owners]

        def bring_back() -> None:
            for pose in kept:
                pose.restore(context)

        (motion,) = motions(context, [character], frames_of)
        bending: dict[Take | None, float] = {own: motion.bending}
        if not (keeps_moving and motion.is_bent):
            for take in takes:
                bring_back()
                if take is not own and _act(take, owners):
                    bending[take] = motions(context, [character], frames_of)[0].bending
        best = max(bending, key=bending.__getitem__)  # the assigned one, if all are static
        bring_back()
        if best is not None and best is not own:
            _act(best, owners)
        yield [_note(character, best, [take for take in takes if take is not best])]


def _note(character: Character, take: Take | None, others: list[Take]) -> Message:
    if take is not None and not others:
        return Message('"{name}": the poses are from the action "{action}"', name=character.name, action=take.name)
    names = ", ".join(f'"{other.name}"' for other in others[:NAMED]) + " …" * (len(others) > NAMED)
    if take is None:
        return Message(
            '"{name}": the poses are from its animation as it is; actions in this file: {others}',
            name=character.name, others=names,
        )  # fmt: skip
    return Message(
        '"{name}": the poses are from the action "{action}"; others: {others}',
        name=character.name, action=take.name, others=names,
    )  # fmt: skip


def _owner(character: Character) -> Posable | None:
    """The armature of a character, or its shape keys."""
    return armature_with_bones(character) or next(
        filter(None, (obj.data.shape_keys for obj in character.objects)), None
    )


def _owners(character: Character) -> list[Posable]:
    """What takes of a character move: its armature or shape keys, or else its objects and their parents."""
    owner = _owner(character)
    if owner is not None:
        return [owner]
    return [block for block in character.animated() if block.animation_data is not None]


def _takes(character: Character) -> list[Take]:
    """The animations that can move a character."""
    owner = _owner(character)
    if owner is not None:
        return [Take(action.name, {owner: (action, None)}) for action in actions_for(owner)]
    # Importers put each animation of a file into muted NLA tracks of that name, one on each object.
    found: dict[str, dict[bpy.types.ID, tuple[bpy.types.Action, Any]]] = {}
    for block in _owners(character):
        for track in block.animation_data.nla_tracks:
            if track.mute and len(track.strips) == 1 and track.strips[0].action is not None:
                (strip,) = track.strips
                found.setdefault(track.name, {})[block] = strip.action, getattr(strip, "action_slot", None)
    return [Take(name, actions) for name, actions in found.items()]


def _assigned(takes: Sequence[Take], owners: Sequence[Posable]) -> Take | None:
    """The take that is assigned; None if nothing is."""
    now = {owner: action for owner in owners if (action := _action(owner)) is not None}
    if not now:
        return None
    for take in takes:
        if {owner: action for owner, (action, _) in take.actions.items()} == now:
            return take
    return Take(next(iter(now.values())).name, {owner: (action, None) for owner, action in now.items()})


def _may_act(context: bpy.types.Context, character: Character, owner: Posable) -> bool:
    """Whether another action can be tried: not in tweak mode, not on linked data, and not if a simulation would lose
    its frames by that."""
    data = owner.animation_data
    is_free = owner.library is None and owner.override_library is None
    return is_free and not (data and data.use_tweak_mode) and not must_not_change(context.scene, character)


def _action(owner: bpy.types.ID) -> bpy.types.Action | None:
    return None if owner.animation_data is None else owner.animation_data.action


def _act(take: Take, owners: Sequence[Posable]) -> bool:
    """Let a take alone move its owners, armatures and shape keys from rest; False if it does not fit."""
    for owner in owners:
        to_rest(owner)
        if owner in take.actions:
            action, slot = take.actions[owner]
            try:
                assign_action(owner, action)
            except UserError:
                return False
            if slot is not None:
                owner.animation_data.action_slot = slot
        else:
            owner.animation_data.action = None
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
