"""Meshes for the benchmarks: bodies with limbs, with any number of vertices."""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull

from wks_segment.core import TriangleMesh
from wks_segment.core.mesh.triangle_mesh import FloatArray

LIMBS = (
    ((1.0, 0.1, 0.2), 3.0, 0.35),
    ((-0.6, 0.8, 0.1), 1.6, 0.40),
    ((-0.6, -0.8, 0.1), 1.6, 0.40),
    ((0.2, 0.5, -0.9), 1.4, 0.30),
    ((0.2, -0.5, -0.9), 1.4, 0.30),
    ((0.0, 0.0, 1.0), 2.0, 0.25),
)
"""Direction, length and width of each limb, by which a unit sphere is deformed."""


def body(n_vertices: int, bend: float = 0.3, irregular: bool = False) -> TriangleMesh:
    """A closed body with six limbs, posed by `bend`; its vertices are spread evenly, or at random if `irregular`."""
    if irregular:
        points = np.random.default_rng(0).standard_normal((n_vertices, 3))
    else:
        # Fibonacci sphere: each point is a golden angle further, at equal steps of height.
        height = 1 - (2 * np.arange(n_vertices) + 1) / n_vertices
        angle = np.pi * (3 - 5**0.5) * np.arange(n_vertices)
        radius = np.sqrt(1 - height**2)
        points = np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=1)
    points /= np.linalg.norm(points, axis=1)[:, None]
    faces = ConvexHull(points).simplices
    a, b, c = (points[faces[:, i]] for i in range(3))
    inward = np.einsum("ij,ij->i", np.cross(b - a, c - a), a) < 0
    faces[inward] = faces[inward, ::-1]
    return TriangleMesh(_posed(_with_limbs(points), bend), faces)


KEPT_SHARE = 0.84
"""Share of the vertices that `with_border` keeps."""


def with_border(mesh: TriangleMesh) -> TriangleMesh:
    """The mesh without the sixth of its faces that is lowest."""
    height = mesh.vertices[mesh.faces, 2].mean(axis=1)
    kept = mesh.faces[height > np.quantile(height, 1 / 6)]
    used, faces = np.unique(kept, return_inverse=True)
    return TriangleMesh(mesh.vertices[used], faces.reshape(-1, 3))


def thinned(mesh: TriangleMesh) -> TriangleMesh:
    """The mesh scaled to a fiftieth of its height, so that two sides almost touch."""
    return TriangleMesh(mesh.vertices * (1, 1, 0.02), mesh.faces)


def with_islands(mesh: TriangleMesh, n_islands: int = 12) -> TriangleMesh:
    """The mesh with small closed islands beside it, each an eighth of its length."""
    island = body(max(mesh.n_vertices // 100, 50))
    places = 4 * np.random.default_rng(1).standard_normal((n_islands, 3))
    vertices = [mesh.vertices, *(island.vertices / 8 + place for place in places)]
    starts = mesh.n_vertices + island.n_vertices * np.arange(n_islands)
    return TriangleMesh(np.concatenate(vertices), np.concatenate([mesh.faces, *(island.faces + s for s in starts)]))


def _with_limbs(points: FloatArray) -> FloatArray:
    pulled = points.copy()
    for direction, length, width in LIMBS:
        axis = np.array(direction) / np.linalg.norm(direction)
        angle = np.arccos(np.clip(points @ axis, -1, 1))
        pulled += length * np.exp(-((angle / width) ** 2))[:, None] * axis
    return pulled


def _posed(points: FloatArray, bend: float) -> FloatArray:
    """Rotate points about the z axis, by an angle that grows with the distance from the middle."""
    turn = bend * np.maximum(np.linalg.norm(points, axis=1) - 1.2, 0) / 2
    x, y, z = points.T
    return np.stack([x * np.cos(turn) - y * np.sin(turn), x * np.sin(turn) + y * np.cos(turn), z], axis=1)
