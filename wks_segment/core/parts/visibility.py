"""Which places of a surface see each other through its inside: parts are about convex, and see themselves.

After van Kaick, Fish, Kleiman, Asafi and Cohen-Or, "Shape segmentation by approximate convexity analysis" (2014), who
merge patches by their line of sight.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from ..geometry.creases import FINE
from ..mesh.canonical import in_steps
from ..mesh.triangle_mesh import BoolArray, FloatArray, IntArray
from ..poses.pose_cache import Workpiece
from ..progress import Progress

PLACES = 8
"""Number of places on a line of sight that must be inside: gaps that matter are wider than their distance."""
SLACK = 0.004
"""How far outside, in units of the square root of the area, a line of sight may run, since surfaces are bent."""
OUTWARD = 0.05
"""Sine of the angle by which a line may leave the surface on the outer side: faces of one flat patch see each other."""
NEAREST_SLACK = 0.2
"""Relative error that the search for the nearest vertex may make: it matters near the surface, where it is small."""
MOST_VERTICES = 3_000
"""Most vertices among which the nearest is searched for; with all of them 0.1 % of the lines differ."""


def visible(pose: Workpiece, faces: IntArray, progress: Progress | None = None) -> BoolArray:
    """(r, r) whether the centers of some faces of a pose see each other through the inside; true on the diagonal."""
    surface = pose.surface
    unit = np.sqrt(surface.mesh.area)
    vertices = surface.mesh.vertices / unit
    normals = pose.normals.over(FINE)
    places = in_steps(surface.to_faces(vertices)[faces])
    directions = surface.to_faces(normals)[faces]
    stride = max(1, len(vertices) // MOST_VERTICES)
    sight = _Sight(vertices[::stride], normals[::stride])
    count = len(faces)
    first, second = np.triu_indices(count, 1)
    lines = places[second] - places[first]
    lengths = np.linalg.norm(lines, axis=1)
    limit = SLACK + OUTWARD * lengths
    inward = (np.einsum("ij,ij->i", lines, directions[first]) < limit) & (
        np.einsum("ij,ij->i", lines, directions[second]) > -limit
    )
    free = np.flatnonzero(inward)
    # From the middle outward: most lines that leave the inside do so there.
    shares = (np.arange(PLACES) + 0.5) / PLACES
    known = np.zeros((len(lines), PLACES), dtype=bool)
    for i, _ in Progress.of(progress).each(np.argsort(np.abs(shares - 0.5), kind="stable").tolist()):
        asked = free[~known[free, i]]
        inside, radius = sight.look(places[first[asked]] + shares[i] * lines[asked])
        # No vertex is much nearer than the one that was found: the line stays inside as far as that.
        known[asked] |= np.abs(shares - shares[i]) * lengths[asked, None] <= radius[:, None]
        free = free[~np.isin(free, asked[~inside], assume_unique=True)]
    result = np.eye(count, dtype=bool)
    result[first[free], second[free]] = True
    return np.asarray(result | result.T)


class _Sight:
    """Vertices with their normals, in which the nearest one tells what is inside."""

    def __init__(self, vertices: FloatArray, normals: FloatArray) -> None:
        self._vertices, self._normals, self._tree = vertices, normals, cKDTree(vertices)

    def look(self, places: FloatArray) -> tuple[BoolArray, FloatArray]:
        """(k,) whether each place is inside, or hardly outside, and how far away the nearest vertex is."""
        distances, nearest = self._tree.query(places, eps=NEAREST_SLACK)
        heights = np.einsum("ij,ij->i", places - self._vertices[nearest], self._normals[nearest])
        return np.asarray(heights < SLACK), np.asarray(distances)
