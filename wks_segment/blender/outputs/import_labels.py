"""The way back: parts from face sets, materials or vertex groups as an artist has corrected them."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np

from ...core.mesh.triangle_mesh import FloatArray, IntArray
from ..errors import UserError
from ..parts.part_ids import SIDE_STEP, segments_of
from ..scene.attributes import read_attribute, read_ints
from ..scene.characters import Character
from .face_sets import FACE_SETS, FIRST
from .ledger import note_of
from .materials import COMPONENT
from .vertex_groups import group_weights, our_groups

FACE_SET, MATERIAL, GROUP = "FACE_SETS", "MATERIALS", "VERTEX_GROUPS"
SOURCES = (
    (FACE_SET, "Face Sets", "As they are drawn in sculpt mode"),
    (MATERIAL, "Materials", "As they are assigned to faces"),
    (
        GROUP,
        "Vertex Groups",
        "A face is of the group that weighs most on its corners: of those of segments and those added since, or of all "
        "where there are none of segments",
    ),
)
"""Where parts can come from, as an enum property takes it."""


@dataclass(frozen=True)
class _Found:
    """What the polygons of a mesh are in: (p,) indices of keys, and the part of each key that is one of ours."""

    index: IntArray
    keys: Sequence[Hashable]
    ours: Mapping[Any, int]


def corrected_parts(character: Character, source: str) -> dict[Hashable, int]:
    """Part of each face set (its number), material or vertex group (its name) of a character, by one of `SOURCES`.

    What we wrote keeps its part; what an artist added gets the lowest numbers of which there is no part, in order.

    Raises
    ------
    UserError
        If there is nothing of that kind on an object.
    """
    found = [_find(obj, source) for obj in character.objects]
    parts = {key: part for of in found for key, part in of.ours.items()}
    taken = set(segments_of(np.array(list(parts.values()), dtype=np.int64)).tolist())
    free = iter([segment for segment in range(SIDE_STEP) if segment not in taken])
    for of in found:
        for i in np.unique(of.index).tolist():
            if of.keys[i] not in parts:
                part = next(free, None)
                if part is None:
                    raise UserError(f'"{character.name}" has more than {SIDE_STEP} of them: too many for segments')
                parts[of.keys[i]] = part
    return parts


def corrected_labels(character: Character, source: str, parts: dict[Hashable, int]) -> IntArray:
    """(p,) part of each of a character's polygons, by what `corrected_parts` gave."""
    found = (_find(obj, source) for obj in character.objects)
    return np.concatenate([np.array([parts.get(key, 0) for key in of.keys], dtype=np.int64)[of.index] for of in found])


def corrected_weights(character: Character, parts: dict[Hashable, int]) -> dict[int, FloatArray]:
    """(n,) weights of each part at the character's vertices, by what `corrected_parts` gave for vertex groups."""
    weights = [group_weights(obj.data) for obj in character.objects]
    empty = [np.zeros(len(obj.data.vertices)) for obj in character.objects]
    return {
        part: np.concatenate([of.get(key, none) for of, none in zip(weights, empty, strict=True)])
        for key, part in parts.items()
        if isinstance(key, str)
    }


def _find(obj: bpy.types.Object, source: str) -> _Found:
    return {FACE_SET: _face_sets, MATERIAL: _materials, GROUP: _groups}[source](obj)


def _face_sets(obj: bpy.types.Object) -> _Found:
    numbers = read_attribute(obj.data, FACE_SETS)
    if numbers is None:
        raise UserError(f'"{obj.name}" has no face sets: draw some in sculpt mode, or write those of segments')
    keys, index = np.unique(numbers, return_inverse=True)
    ours = [int(number) for number in note_of(obj.data).get("face_sets", [])]
    return _Found(index.ravel(), keys.tolist(), {number: number - FIRST for number in ours})


def _materials(obj: bpy.types.Object) -> _Found:
    materials = [slot.material for slot in obj.material_slots]
    if not materials:
        raise UserError(f'"{obj.name}" has no materials: assign some, or write those of segments')
    slots = read_ints(obj.data.polygons, "material_index")
    ours = {material: int(material[COMPONENT]) for material in materials if material and COMPONENT in material}
    # A number beyond the last slot shows the last one.
    return _Found(np.minimum(slots, len(materials) - 1), materials, ours)


def _groups(obj: bpy.types.Object) -> _Found:
    note, weights = note_of(obj.data), group_weights(obj.data)
    ours = our_groups(obj.data, note)
    names = [name for name in weights if not ours or name not in note.get("own_groups", [])]
    if not names:
        raise UserError(f'"{obj.name}" has no vertex groups: add some, or write those of segments')
    corners, starts = read_ints(obj.data.loops, "vertex_index"), read_ints(obj.data.polygons, "loop_start")
    sums = np.add.reduceat(np.stack([weights[name] for name in names], axis=1)[corners], starts, axis=0)
    # Faces of no group are of one more part.
    index = np.where(sums.any(axis=1), sums.argmax(axis=1), len(names))
    return _Found(index, [*names, None], ours)
