"""Reads the poses to learn from, from the source that the settings name."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import bpy

from ..errors import UserError
from ..props.settings import WKSSegmentSettings
from . import poses
from .animation import Choice, animated
from .characters import Character, armature_of, group, selected_meshes
from .pose_library import read_actions
from .poses import Pose
from .simulations import check_simulations
from .touching import joined


class Told(Protocol):
    """What is told of the poses that were read: a report."""

    choices: list[str]
    left_out: list[str]


def read_training_poses(
    context: bpy.types.Context, settings: WKSSegmentSettings, told: Told,
    objects: Sequence[bpy.types.Object] | None = None,
) -> list[Pose]:  # fmt: skip
    """Poses to learn from, of the selected meshes or of some objects, read from the source that the settings name.

    Raises
    ------
    UserError
        If there are no poses, or they cannot be used.
    """
    scene, source = context.scene, settings.source
    selected = selected_meshes(context) if objects is None else objects
    if source == "OBJECTS":
        characters = group(selected, together=settings.one_character)
        check_simulations(scene, characters, over_time=False)
        return poses.read_objects(context, characters)
    characters = group(selected)
    check_simulations(scene, characters, over_time=source in ("FRAMES", "MARKERS"))
    if source in ("SHAPE_KEYS", "ACTIONS"):
        characters, notes = joined(context, characters)
        told.choices += notes
        read = poses.read_shape_keys if source == "SHAPE_KEYS" else read_actions
        return read(context, active_character(context, characters), settings.pose_count)

    def frames_of(character: Character) -> list[int]:
        if source == "MARKERS":
            return list(poses.marked_frames(scene, settings.pose_count))
        return chosen_frames(scene, character, settings)

    active = frozenset(obj for obj in (context.active_object,) if obj is not None)
    choice = Choice(chosen=active, actions=source == "FRAMES", keeps_moving=True)
    with animated(context, characters, frames_of, choice) as found:
        told.choices += found.notes
        character = active_character(context, found.characters)
        names = list(poses.marked_frames(scene, settings.pose_count).values()) if source == "MARKERS" else None
        return poses.read_frames(context, character, frames_of(character), names, told.left_out)


def active_character(context: bpy.types.Context, characters: Sequence[Character]) -> Character:
    """The selected character that the active object belongs to, or the only one.

    Raises
    ------
    UserError
        If there are several, and the active object belongs to none of them.
    """
    active = context.active_object
    for character in characters:
        members = (*character.objects, armature_of(character.objects[0]))
        if len(characters) == 1 or (active is not None and active in members):
            return character
    names = ", ".join(character.name for character in characters[:5])
    raise UserError(
        "{count} characters are selected ({names}): click the one whose poses are meant",
        count=len(characters), names=names,
    )  # fmt: skip


def chosen_frames(scene: bpy.types.Scene, character: Character, settings: WKSSegmentSettings) -> list[int]:
    """Frames to read poses at: from the user's range, the character's own animation, or the scene's range.

    Raises
    ------
    UserError
        If the user's range ends before it begins.
    """
    if not settings.use_frame_range:
        return poses.own_frames(scene, character, settings.pose_count)
    if settings.frame_last < settings.frame_first:
        raise UserError(
            "The frame range ends ({last}) before it begins ({first}): swap them",
            last=settings.frame_last, first=settings.frame_first,
        )  # fmt: skip
    return poses.evenly(settings.frame_first, settings.frame_last, settings.pose_count)
