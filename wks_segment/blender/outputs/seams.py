"""Marks the borders of parts as UV seams and takes those marks back."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np

from ...core.mesh.triangle_mesh import BoolArray, IntArray
from .ledger import NOTE, add_attribute, note_of, read_attribute

SEAMS = "wks_segment_seam"
"""Edge attribute: where a seam is ours."""
BLENDERS = ("uv_seam", ".uv_seam")
"""The edge attribute that holds seams: since Blender 5.0, and before."""


def write_seams(mesh: bpy.types.Mesh, labels: IntArray) -> None:
    """Mark the edges between polygons of different parts, given the (p,) parts; seams that are there stay."""
    own = _seams(mesh)
    ours = borders(mesh, labels) & ~own
    mesh[NOTE]["had_seams"] = _attribute(mesh) is not None
    add_attribute(mesh, "seams", SEAMS, "BOOLEAN", "EDGE", ours)
    mesh.edges.foreach_set("use_seam", own | ours)


def own_seams(mesh: bpy.types.Mesh) -> BoolArray:
    """(e,) whether an edge has a seam of the artist: the seams that Clear leaves."""
    ours = read_attribute(mesh, note_of(mesh).get("seams", ""), bool)
    return _seams(mesh) if ours is None else _seams(mesh) & ~ours


def remove_seams(mesh: bpy.types.Mesh, note: dict[str, Any]) -> None:
    """Take back the seams that `write_seams` added."""
    if note.get("seams", "") not in mesh.attributes:
        return
    own = own_seams(mesh)
    mesh.edges.foreach_set("use_seam", own)
    attribute = _attribute(mesh)
    if not note["had_seams"] and attribute is not None and not own.any():
        mesh.attributes.remove(attribute)


def borders(mesh: bpy.types.Mesh, labels: IntArray) -> BoolArray:
    """(e,) whether an edge lies between polygons of different parts, given the (p,) parts."""
    edge = np.empty(len(mesh.loops), dtype=np.int32)
    mesh.loops.foreach_get("edge_index", edge)
    corners = np.empty(len(mesh.polygons), dtype=np.int32)
    mesh.polygons.foreach_get("loop_total", corners)
    part = np.repeat(labels, corners)
    least = np.full(len(mesh.edges), np.iinfo(np.int64).max)
    most = np.full(len(mesh.edges), -1)
    np.minimum.at(least, edge, part)
    np.maximum.at(most, edge, part)
    return np.asarray(least < most)


def _seams(mesh: bpy.types.Mesh) -> BoolArray:
    values = np.empty(len(mesh.edges), dtype=bool)
    mesh.edges.foreach_get("use_seam", values)
    return values


def _attribute(mesh: bpy.types.Mesh) -> bpy.types.Attribute | None:
    return next((mesh.attributes[name] for name in BLENDERS if name in mesh.attributes), None)
