"""A character's own meshes in arrays: what labeling needs of them, read in one go so that it needs no Blender."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import bpy
import numpy as np

from ...core.mesh.triangle_mesh import FloatArray, IntArray
from .characters import Character
from .marked_edges import marked_pairs
from .poses import polygon_ranges, vertex_ranges


@dataclass(frozen=True, eq=False)
class Body:
    """The meshes of all objects of a character as modeled; they are numbered one object after another.

    Attributes
    ----------
    vertices : (n, 3) array
        In world space.
    polygons : (p, 3) array
        Their centers.
    corners : tuple of two (c,) int arrays
        Vertex and polygon of each corner.
    marked : (q, 2) int array or None
        Neighboring polygons between which a border is welcome; see `marked_pairs`.
    """

    vertices: FloatArray
    polygons: FloatArray
    corners: tuple[IntArray, IntArray]
    marked: IntArray | None = None

    @classmethod
    def of(cls, character: Character, snap_to: Collection[str] = ()) -> Body:
        """Read a character as it is now."""
        vertices: list[FloatArray] = []
        polygons: list[FloatArray] = []
        corners: list[tuple[IntArray, IntArray]] = []
        for (obj, its_vertices), (_, its) in zip(vertex_ranges(character), polygon_ranges(character), strict=True):
            vertices.append(_in_world(obj, obj.data.vertices, "co"))
            polygons.append(_in_world(obj, obj.data.polygons, "center"))
            vertex, polygon = corners_of(obj.data)
            corners.append((vertex + its_vertices.start, polygon + its.start))
        at_vertex, at_polygon = (np.concatenate(each) for each in zip(*corners, strict=True))
        marked = marked_pairs(character, snap_to)
        return cls(np.concatenate(vertices), np.concatenate(polygons), (at_vertex, at_polygon), marked)


def corners_of(mesh: bpy.types.Mesh) -> tuple[IntArray, IntArray]:
    """Vertex and polygon of each corner of a mesh."""
    vertices = np.empty(len(mesh.loops), dtype=np.int32)
    mesh.loops.foreach_get("vertex_index", vertices)
    size = np.empty(len(mesh.polygons), dtype=np.int32)
    mesh.polygons.foreach_get("loop_total", size)
    return vertices.astype(np.int64), np.repeat(np.arange(len(size)), size)


def _in_world(obj: bpy.types.Object, collection: bpy.types.bpy_prop_collection, name: str) -> FloatArray:
    places = np.empty((len(collection), 3), dtype=np.float32)
    collection.foreach_get(name, places.ravel())
    world = np.array(obj.matrix_world)
    return np.asarray(places @ world[:3, :3].T + world[:3, 3])
