"""Which places of a surface see each other through its inside: parts are about convex, and see themselves.

After van Kaick, Fish, Kleiman, Asafi and Cohen-Or, "Shape segmentation by approximate convexity analysis" (2014), who
merge patches by their line of sight.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from ..geometry.creases import smooth_normals, vertex_normals
from ..mesh.triangle_mesh import BoolArray, FloatArray, IntArray
from ..poses.pose_cache import Workpiece
from ..progress import Progress

PLACES = 8
"""Number of places on a line of sight that must be inside: gaps that matter are wider than their distance."""
SLACK = 0.004
"""How far outside, in units of the square root of the area, a line of sight may run, since surfaces are bent."""
OUTWARD = 0.05
"""Sine of the angle by which a line may leave the surface on the outer side: faces of one flat patch see each other."""
NORMAL_LENGTH = 0.012
"""Length over which normals are averaged, in the same unit."""
NEAREST_SLACK = 0.01
"""Relative error that the search for the nearest vertex may make."""


def visible(pose: Workpiece, faces: IntArray, progress: Progress | None = None) -> BoolArray:
    """(r, r) whether the centers of some faces of a pose see each other through the inside; true on the diagonal."""
    surface = pose.surface
    unit = np.sqrt(surface.mesh.area)
    vertices = surface.mesh.vertices / unit
    normals = smooth_normals(vertex_normals(surface), pose.flows.short(NORMAL_LENGTH))
    tree = cKDTree(vertices)
    places = surface.to_faces(vertices)[faces]
    directions = surface.to_faces(normals)[faces]
    count = len(faces)
    first, second = np.triu_indices(count, 1)
    lines = places[second] - places[first]
    limit = SLACK + OUTWARD * np.linalg.norm(lines, axis=1)
    inward = (np.einsum("ij,ij->i", lines, directions[first]) < limit) & (
        np.einsum("ij,ij->i", lines, directions[second]) > -limit
    )
    open_lines = np.flatnonzero(inward)
    # From the middle outward: most lines that leave the inside do so there.
    shares = (np.arange(PLACES) + 0.5) / PLACES
    for share, _ in Progress.of(progress).each(sorted(shares, key=lambda share: abs(share - 0.5))):
        at = places[first[open_lines]] + share * lines[open_lines]
        open_lines = open_lines[_inside(tree, vertices, normals, at)]
    result = np.eye(count, dtype=bool)
    result[first[open_lines], second[open_lines]] = True
    return np.asarray(result | result.T)


def _inside(tree: cKDTree, vertices: FloatArray, normals: FloatArray, places: FloatArray) -> BoolArray:
    """(k,) whether each place is inside, or hardly outside, by the normal of the nearest vertex."""
    nearest = tree.query(places, eps=NEAREST_SLACK)[1]
    return np.asarray(np.einsum("ij,ij->i", places - vertices[nearest], normals[nearest]) < SLACK)
