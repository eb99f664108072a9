"""Writes parts as face sets, which sculpt mode shows, and gives those of the artist back."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np

from ...core.mesh.triangle_mesh import IntArray
from ..parts import part_ids
from ..scene.attributes import read_attribute, write_attribute
from .ledger import NOTE, add_attribute

FACE_SETS = ".sculpt_face_set"
"""Blender's own face attribute: the number of the face set, from 1."""
OWN_FACE_SETS = "wks_segment_own_face_set"
"""Face attribute that keeps the face set of each face from before ours."""
FIRST = 1
"""Face set of part 0."""


def write_face_sets(mesh: bpy.types.Mesh, labels: IntArray) -> None:
    """Put each polygon into the face set of its part, given the (p,) parts."""
    own = read_attribute(mesh, FACE_SETS)
    if own is None:
        mesh.attributes.new(FACE_SETS, "INT", "FACE")
    else:
        add_attribute(mesh, "own_face_sets", OWN_FACE_SETS, "INT", "FACE", own)
    mesh[NOTE]["face_sets"] = [part + FIRST for part in part_ids.unique_parts(labels)]
    write_attribute(mesh.attributes[FACE_SETS], labels + FIRST)


def remove_face_sets(mesh: bpy.types.Mesh, note: dict[str, Any]) -> None:
    """Give faces that still are in a face set of ours their own back; sets that the artist drew since stay."""
    now = read_attribute(mesh, FACE_SETS)
    if "face_sets" not in note or now is None:
        return
    ours = np.isin(now, list(note["face_sets"]))
    own = read_attribute(mesh, note.get("own_face_sets", ""))
    if own is None and ours.all():
        mesh.attributes.remove(mesh.attributes[FACE_SETS])
        return
    now[ours] = FIRST if own is None else own[ours]
    write_attribute(mesh.attributes[FACE_SETS], now)
