"""A character's own meshes as arrays: what labeling needs of them, read at once so that threads need no Blender."""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np

from ...core.mesh.triangle_mesh import FloatArray, IntArray
from .attributes import Elements, read_floats
from .characters import Character, polygon_ranges, vertex_ranges
from .topology import corners_of


@dataclass(frozen=True, eq=False)
class Body:
    """The meshes of all objects of a character as modeled, numbered one object after another.

    Attributes
    ----------
    vertices : (n, 3) array
        Positions in world space.
    polygon_centers : (p, 3) array
        In world space.
    corners : tuple of two (c,) int arrays
        Vertex and polygon of each corner.
    marked : (q, 2) int array or None
        Pairs of neighboring polygons between which a border is welcome; see `marked_pairs`.
    """

    vertices: FloatArray
    polygon_centers: FloatArray
    corners: tuple[IntArray, IntArray]
    marked: IntArray | None = None

    @classmethod
    def of(cls, character: Character, marked: IntArray | None = None) -> Body:
        """Read a character as it is now."""
        vertices: list[FloatArray] = []
        centers: list[FloatArray] = []
        corners: list[tuple[IntArray, IntArray]] = []
        for (obj, vertex_range), (_, polygon_range) in zip(
            vertex_ranges(character), polygon_ranges(character), strict=True
        ):
            vertices.append(_in_world(obj, obj.data.vertices, "co"))
            centers.append(_in_world(obj, obj.data.polygons, "center"))
            vertex, polygon = corners_of(obj.data)
            corners.append((vertex + vertex_range.start, polygon + polygon_range.start))
        vertex_of_corner, polygon_of_corner = (np.concatenate(arrays) for arrays in zip(*corners, strict=True))
        return cls(np.concatenate(vertices), np.concatenate(centers), (vertex_of_corner, polygon_of_corner), marked)


def _in_world(obj: bpy.types.Object, elements: Elements, prop: str) -> FloatArray:
    """(n, 3) places of elements of an object's mesh, in world space."""
    world = np.array(obj.matrix_world)
    return np.asarray(read_floats(elements, prop, 3) @ world[:3, :3].T + world[:3, 3])
