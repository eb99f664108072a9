"""Reads parts back from face sets, materials or vertex groups, as an artist has corrected them."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np

from ...core.mesh.triangle_mesh import FloatArray, IntArray
from ..errors import UserError
from ..parts.part_ids import SIDE_STEP, segments_of
from ..scene.attributes import read_attribute, read_ints
from ..scene.characters import Character
from ..scene.vertex_group_access import group_weights
from .face_sets import FACE_SET_ATTRIBUTE, FIRST_FACE_SET
from .ledger import Ledger
from .part_materials import part_of
from .vertex_groups import our_groups, own_groups

FACE_SETS, MATERIALS, VERTEX_GROUPS = "FACE_SETS", "MATERIALS", "VERTEX_GROUPS"
LABEL_SOURCES = (
    (FACE_SETS, "Face Sets", "As they are drawn in Sculpt Mode"),
    (MATERIALS, "Materials", "As they are assigned to faces"),
    (
        VERTEX_GROUPS,
        "Vertex Groups",
        "A face belongs to the group that weighs most on its corners: among the groups of segments and groups added "
        "since, or among all groups if none is of a segment",
    ),
)
"""What parts can be read from, as items of an enum property."""


@dataclass(frozen=True)
class Membership:
    """What the polygons of a mesh are in: (p,) indices of keys, and the part of each key that is one of ours."""

    index: IntArray
    keys: Sequence[Hashable]
    ours: Mapping[Any, int]


def corrected_parts(
    character: Character, source: str, make_part: Callable[[], int] | None = None
) -> dict[Hashable, int]:
    """Part of each face set (its number), material or vertex group (its name) of a character.

    What we wrote keeps its part.

    Parameters
    ----------
    source : str
        One of `LABEL_SOURCES`.
    make_part : callable, optional
        Gives the number of a new part, for what an artist added; the lowest that no part has if not given.

    Raises
    ------
    UserError
        If an object has nothing of that kind.
    """
    memberships = [membership_of(obj, source) for obj in character.objects]
    parts = {key: part for membership in memberships for key, part in membership.ours.items()}
    taken = set(segments_of(np.array(list(parts.values()), dtype=np.int64)).tolist())
    free = iter([segment for segment in range(SIDE_STEP) if segment not in taken])
    for membership in memberships:
        for i in np.unique(membership.index).tolist():
            if membership.keys[i] not in parts:
                part = next(free, None) if make_part is None else make_part()
                if part is None:
                    raise UserError(
                        '"{name}" has too many of these for segments, more than {count}',
                        name=character.name,
                        count=SIDE_STEP,
                    )
                parts[membership.keys[i]] = part
    return parts


def corrected_labels(character: Character, source: str, parts: dict[Hashable, int]) -> IntArray:
    """(p,) part of each of a character's polygons, given the parts from `corrected_parts`."""
    labels = []
    for obj in character.objects:
        membership = membership_of(obj, source)
        numbers = np.array([parts.get(key, 0) for key in membership.keys], dtype=np.int64)
        labels.append(numbers[membership.index])
    return np.concatenate(labels)


def corrected_weights(character: Character, parts: dict[Hashable, int]) -> dict[int, FloatArray]:
    """(n,) weights of the character's vertices in each part, given the parts of its vertex groups."""
    weights = [(group_weights(obj.data), np.zeros(len(obj.data.vertices))) for obj in character.objects]
    return {
        part: np.concatenate([groups.get(key, zeros) for groups, zeros in weights])
        for key, part in parts.items()
        if isinstance(key, str)
    }


def membership_of(obj: bpy.types.Object, source: str) -> Membership:
    """What the polygons of an object are in; UserError if it has nothing of that kind."""
    return {FACE_SETS: _in_face_sets, MATERIALS: _in_materials, VERTEX_GROUPS: _in_groups}[source](obj)


def _in_face_sets(obj: bpy.types.Object) -> Membership:
    numbers = read_attribute(obj.data, FACE_SET_ATTRIBUTE)
    if numbers is None:
        raise UserError(
            '"{name}" has no face sets: draw some in Sculpt Mode, or let segments write theirs', name=obj.name
        )
    keys, index = np.unique(numbers, return_inverse=True)
    ours = [int(number) for number in Ledger(obj.data).get("face_sets", [])]
    return Membership(index.ravel(), keys.tolist(), {number: number - FIRST_FACE_SET for number in ours})


def _in_materials(obj: bpy.types.Object) -> Membership:
    materials = [slot.material for slot in obj.material_slots]
    if not materials:
        raise UserError('"{name}" has no materials: assign some, or let segments write theirs', name=obj.name)
    slots = read_ints(obj.data.polygons, "material_index")
    ours = {material: part for material in materials if (part := part_of(material)) is not None}
    # Blender shows the last material on faces with an index beyond the last slot.
    return Membership(np.minimum(slots, len(materials) - 1), materials, ours)


def _in_groups(obj: bpy.types.Object) -> Membership:
    weights, ours = group_weights(obj.data), our_groups(obj.data)
    names = [name for name in weights if not ours or name not in own_groups(obj.data)]
    if not names:
        raise UserError('"{name}" has no vertex groups: add some, or let segments write theirs', name=obj.name)
    vertices, starts = read_ints(obj.data.loops, "vertex_index"), read_ints(obj.data.polygons, "loop_start")
    sums = np.add.reduceat(np.stack([weights[name] for name in names], axis=1)[vertices], starts, axis=0)
    # Faces in no group are one more part.
    index = np.where(sums.any(axis=1), sums.argmax(axis=1), len(names))
    return Membership(index, [*names, None], ours)
