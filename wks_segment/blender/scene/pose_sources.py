"""Reads the poses to learn from, from the source that the settings name."""

from __future__ import annotations

from collections.abc import Sequence

import bpy

from ..errors import UserError
from ..props.settings import WKSSegmentSettings
from . import poses
from .characters import Character, armature_of, group, selected_meshes
from .pose_library import read_actions
from .poses import Pose


def read_training_poses(context: bpy.types.Context, settings: WKSSegmentSettings) -> list[Pose]:
    """Poses to learn from, read from the source that the settings name.

    Raises
    ------
    UserError
        If there are no poses, or they cannot be used.
    """
    characters = group(selected_meshes(context))
    if settings.source == "OBJECTS":
        return poses.read_objects(context, characters)
    character = active_character(context, characters)
    if settings.source == "SHAPE_KEYS":
        return poses.read_shape_keys(context, character, settings.pose_count)
    if settings.source == "MARKERS":
        return poses.read_markers(context, character, settings.pose_count)
    if settings.source == "ACTIONS":
        return read_actions(context, character, settings.pose_count)
    return poses.read_frames(context, character, chosen_frames(context.scene, character, settings))


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
