"""Where an artist has marked a border: polygons on the two sides of sharp edges, of seams, of a change of material."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core.mesh.triangle_mesh import BoolArray, IntArray
from ..outputs.materials import own_material_index
from ..outputs.seams import own_seams
from .characters import Character
from .poses import polygon_ranges

SHARP, MATERIALS = "sharp", "materials"
MOST_AROUND = 8
"""Polygons at one edge that are all neighbors of each other, less one; of more, those that follow each other are."""


def marked_pairs(character: Character, kinds: Collection[str]) -> IntArray | None:
    """(q, 2) neighboring polygons between which there is a mark of these kinds; None if there are no kinds.

    The polygons of all objects are numbered one object after another, as in `Pose.polygon_of`.
    """
    if not kinds:
        return None
    ranges = polygon_ranges(character)
    return np.concatenate([polygons.start + _pairs_of_mesh(obj.data, kinds) for obj, polygons in ranges])


def neighbors(mesh: bpy.types.Mesh) -> IntArray:
    """(q, 2) polygons of a mesh that share an edge, also across split vertices."""
    return _neighbors(mesh, _welded_edges(mesh)[0])[0]


def _pairs_of_mesh(mesh: bpy.types.Mesh, kinds: Collection[str]) -> IntArray:
    edge, count = _welded_edges(mesh)
    pairs, between = _neighbors(mesh, edge)
    chosen = np.zeros(len(pairs), dtype=bool)
    for kind in kinds:
        if kind == MATERIALS:
            chosen |= np.diff(own_material_index(mesh)[pairs], axis=1).ravel() != 0
        else:
            marked = np.zeros(count, dtype=bool)
            own = _read(mesh.edges, "use_edge_sharp", bool) if kind == SHARP else own_seams(mesh)
            marked[edge[own]] = True
            chosen |= marked[between]
    return pairs[chosen]


def _welded_edges(mesh: bpy.types.Mesh) -> tuple[IntArray, int]:
    """Number of each edge, the same for edges between the same two places, and how many there are.

    Importers split vertices at seams and where the material changes; the core welds these, too.
    """
    places = _read(mesh.vertices, "co", np.float32, 3)
    order = np.lexsort(places.T)
    new = (np.diff(places[order], axis=0) != 0).any(axis=1)
    place = np.zeros(len(places), dtype=np.int64)
    place[order[1:]] = np.cumsum(new)
    ends = np.sort(place[_read(mesh.edges, "vertices", np.int32, 2)], axis=1)
    found, edge = np.unique(ends @ np.array([len(places), 1]), return_inverse=True)
    return edge.ravel(), len(found)


def _neighbors(mesh: bpy.types.Mesh, edge: IntArray) -> tuple[IntArray, IntArray]:
    """(q, 2) polygons that share an edge, given the number of each edge of the mesh, and (q,) the edge."""
    polygon = np.repeat(np.arange(len(mesh.polygons)), _read(mesh.polygons, "loop_total", np.int32))
    edge = edge[_read(mesh.loops, "edge_index", np.int32)]
    order = np.lexsort((polygon, edge))
    polygon, edge = polygon[order], edge[order]
    pairs, between = [np.zeros((0, 2), dtype=np.int64)], [np.zeros(0, dtype=np.int64)]
    for step in range(1, MOST_AROUND + 1):
        same: BoolArray = (edge[step:] == edge[:-step]) & (polygon[step:] != polygon[:-step])
        pairs.append(np.stack([polygon[:-step][same], polygon[step:][same]], axis=1))
        between.append(edge[step:][same])
    return np.concatenate(pairs), np.concatenate(between)


def _read(collection: bpy.types.bpy_prop_collection, name: str, dtype: type, width: int = 1) -> NDArray[Any]:
    """(n,) or, of more than one number each, (n, width) values of a property."""
    values: NDArray[Any] = np.empty(len(collection) * width, dtype=dtype)
    collection.foreach_get(name, values)
    return values if width == 1 else values.reshape(-1, width)
