"""Marks the borders of parts as UV seams and takes those marks back."""

from __future__ import annotations

from typing import Any

import bpy

from ...core.mesh.triangle_mesh import BoolArray, IntArray
from ..scene.attributes import read_attribute, read_bools, write_bools
from ..scene.topology import border_edges
from .ledger import NOTE, add_attribute, note_of

SEAMS = "wks_segment_seam"
"""Edge attribute: where a seam is ours."""
BLENDERS = ("uv_seam", ".uv_seam")
"""The edge attribute that holds seams: since Blender 5.0, and before."""


def write_seams(mesh: bpy.types.Mesh, labels: IntArray) -> None:
    """Mark the edges between polygons of different parts, given the (p,) parts; seams that are there stay."""
    own = read_bools(mesh.edges, "use_seam")
    ours = border_edges(mesh, labels) & ~own
    mesh[NOTE]["had_seams"] = _attribute(mesh) is not None
    add_attribute(mesh, "seams", SEAMS, "BOOLEAN", "EDGE", ours)
    write_bools(mesh.edges, "use_seam", own | ours)


def own_seams(mesh: bpy.types.Mesh) -> BoolArray:
    """(e,) whether an edge has a seam of the artist: the seams that Clear leaves."""
    seams = read_bools(mesh.edges, "use_seam")
    ours = read_attribute(mesh, note_of(mesh).get("seams", ""))
    return seams if ours is None else seams & ~ours.astype(bool)


def remove_seams(mesh: bpy.types.Mesh, note: dict[str, Any]) -> None:
    """Take back the seams that `write_seams` added."""
    if note.get("seams", "") not in mesh.attributes:
        return
    own = own_seams(mesh)
    write_bools(mesh.edges, "use_seam", own)
    attribute = _attribute(mesh)
    if not note["had_seams"] and attribute is not None and not own.any():
        mesh.attributes.remove(attribute)


def _attribute(mesh: bpy.types.Mesh) -> bpy.types.Attribute | None:
    return next((mesh.attributes[name] for name in BLENDERS if name in mesh.attributes), None)
