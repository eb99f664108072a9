"""How the corners, edges and polygons of a mesh belong together, as arrays."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeVar

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core.mesh.triangle_mesh import BoolArray, IntArray
from .attributes import read_floats, read_ints

if TYPE_CHECKING:
    from ...core.uv.charts import PolygonMesh

MOST_AROUND_EDGE = 8
"""All pairs among up to 9 polygons at one edge are neighbors; with more, each is a neighbor of the 8 that follow it.

It bounds the number of pairs on damaged meshes, where thousands of polygons may share an edge."""
T = TypeVar("T", bound=np.generic)


def polygon_sizes(mesh: bpy.types.Mesh) -> IntArray:
    """(p,) number of corners of each polygon."""
    return read_ints(mesh.polygons, "loop_total")


def at_corners(mesh: bpy.types.Mesh, values: NDArray[T]) -> NDArray[T]:
    """(corners,) value of the polygon of each corner, given the (p,) values of polygons."""
    return np.repeat(values, polygon_sizes(mesh))


def corners_of(mesh: bpy.types.Mesh) -> tuple[IntArray, IntArray]:
    """Vertex and polygon of each corner of a mesh."""
    return read_ints(mesh.loops, "vertex_index"), at_corners(mesh, np.arange(len(mesh.polygons)))


def polygon_mesh(mesh: bpy.types.Mesh) -> PolygonMesh:
    """The polygons of a mesh as arrays."""
    from ...core.uv.charts import PolygonMesh

    mesh.calc_loop_triangles()
    return PolygonMesh(
        read_floats(mesh.vertices, "co", 3).astype(np.float64), len(mesh.edges),
        read_ints(mesh.loops, "vertex_index"), read_ints(mesh.loops, "edge_index"), polygon_sizes(mesh),
        read_ints(mesh.loop_triangles, "loops", 3),
    )  # fmt: skip


def border_edges(mesh: bpy.types.Mesh, labels: IntArray) -> BoolArray:
    """(e,) whether an edge lies between polygons with different labels, given the (p,) labels of polygons."""
    edge = read_ints(mesh.loops, "edge_index")
    label = at_corners(mesh, labels)
    lowest = np.full(len(mesh.edges), np.iinfo(np.int64).max)
    highest = np.full(len(mesh.edges), -1)
    np.minimum.at(lowest, edge, label)
    np.maximum.at(highest, edge, label)
    return np.asarray(lowest < highest)


def neighbors(mesh: bpy.types.Mesh) -> IntArray:
    """(q, 2) pairs of polygons of a mesh that share an edge, also across split vertices."""
    return neighbors_at_edges(mesh, welded_edges(mesh)[0])[0]


def welded_edges(mesh: bpy.types.Mesh) -> tuple[IntArray, int]:
    """(e,) number of each edge, the same for edges between the same two places, and how many numbers there are.

    Importers split vertices at seams and where the material changes; the core welds them as well.
    """
    places = read_floats(mesh.vertices, "co", 3)
    order = np.lexsort(places.T)
    is_new = (np.diff(places[order], axis=0) != 0).any(axis=1)
    place = np.zeros(len(places), dtype=np.int64)
    place[order[1:]] = np.cumsum(is_new)
    ends = np.sort(place[read_ints(mesh.edges, "vertices", 2)], axis=1)
    distinct, edge = np.unique(ends @ np.array([len(places), 1]), return_inverse=True)
    return edge.ravel(), len(distinct)


def neighbors_at_edges(mesh: bpy.types.Mesh, edge_number: IntArray) -> tuple[IntArray, IntArray]:
    """(q, 2) pairs of polygons that share an edge, and the (q,) number of the edge, given the (e,) edge numbers."""
    polygon = at_corners(mesh, np.arange(len(mesh.polygons)))
    edge = edge_number[read_ints(mesh.loops, "edge_index")]
    order = np.lexsort((polygon, edge))
    polygon, edge = polygon[order], edge[order]
    pairs, between = [np.zeros((0, 2), dtype=np.int64)], [np.zeros(0, dtype=np.int64)]
    for step in range(1, MOST_AROUND_EDGE + 1):
        same: BoolArray = (edge[step:] == edge[:-step]) & (polygon[step:] != polygon[:-step])
        pairs.append(np.stack([polygon[:-step][same], polygon[step:][same]], axis=1))
        between.append(edge[step:][same])
    return np.concatenate(pairs), np.concatenate(between)
