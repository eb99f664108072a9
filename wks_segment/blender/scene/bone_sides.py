"""The left side of a character by the names of its bones."""

from __future__ import annotations

import re

import bpy
import numpy as np

from ...core.mesh.triangle_mesh import FloatArray
from .characters import Character, armature_of

LEFT, RIGHT = (
    re.compile(rf"(?:^|[^A-Za-z])(?:{letter}|{letter.lower()}|{word}|{word.lower()}|{word.upper()})(?![a-z])")
    for letter, word in (("L", "Left"), ("R", "Right"))
)
"""Match the names of bones on a side: hand.L, hand_l_01, L-hand, Left hand, mixamorig:LeftHand."""


def left_by_bones(character: Character) -> FloatArray | None:
    """(3,) direction in world space from bones on the right to bones on the left, at rest; None without such bones."""
    for armature in dict.fromkeys(map(armature_of, character.objects)):
        if armature is None:
            continue
        left, right = _center(armature, LEFT), _center(armature, RIGHT)
        if left is not None and right is not None:
            direction = np.array(armature.matrix_world, dtype=np.float64)[:3, :3] @ (left - right)
            if direction.any():
                return np.asarray(direction)
    return None


def _center(armature: bpy.types.Object, names: re.Pattern[str]) -> FloatArray | None:
    """(3,) mean place of the bones whose names match, in the space of the armature; None for no bones."""
    bones = [bone for bone in armature.data.bones if names.search(bone.name)]
    places = [bone.head_local for bone in bones] + [bone.tail_local for bone in bones]
    return np.mean(places, axis=0) if places else None
