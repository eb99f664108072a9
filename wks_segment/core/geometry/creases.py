"""Outward normals, concave creases and thickness of a surface.

Unlike the signature these change when a surface bends, but people go by them when they cut a shape into parts: they cut
along concave creases (the minima rule, Hoffman and Richards 1984) and where the thickness changes (Shapira, Shamir and
Cohen-Or 2008).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from ..mesh.adjacency import FaceAdjacency
from ..mesh.surface import Surface, indicator
from ..mesh.triangle_mesh import BoolArray, FloatArray, IntArray, connected_groups, unique_edges
from ..progress import Progress
from .heat_flow import Flows

FINE, COARSE = 0.012, 0.02
"""Lengths over which normals are averaged, in units of the square root of the area: smaller details are no creases."""
THICKNESS_LENGTH = 0.01
"""Length over which thickness is averaged, in the same unit."""
LARGEST_RADIUS = 0.6
"""Radius from which balls shrink, in the same unit; a sphere has the radius 0.28."""
MAX_SHRINKS = 30
"""Most rounds of shrinking. Five are usual."""
ROUGHNESS_COSINE = 0.5
"""Cosine of the angle between the two points where a ball touches; above it, the second point is roughness of the
surface beside the first one and not its other side."""
SEARCH_SLACK = 0.01
"""Relative error that the search for the nearest point may make."""
MOST_BALLS = 2_000
"""Most vertices at which thickness is measured; others take it from the nearest of these."""
BALLS_AT_ONCE = 2_000
"""Balls between two reports of progress."""
BORDER_CREASE, MOST_CONCAVE, MOST_CONVEX = 0.4, 15.0, 2.0
"""A border is weighted by `exp(BORDER_CREASE * clip(curvature, -MOST_CONCAVE, MOST_CONVEX))`, less in creases …"""
BORDER_STEP, MOST_STEP = 0.1, 40.0
"""… and by `exp(-BORDER_STEP * min(step, MOST_STEP))`, with `step` the change of log thickness per unit of length.
Merging components with both weights labels unseen poses and bodies better (docs/dev/experiments.md)."""
LEAST_DISTANCE = 3e-3
"""Least distance between faces for that change: on tiny faces it would be noise."""
LEAST_THICKNESS = 0.003
"""Added to thickness before its logarithm, in units of the square root of the area, because a sheet has none; also the
least distance between faces for curvature."""


def outward_signs(faces: IntArray, corners: FloatArray) -> FloatArray:
    """(m,) +1 for each face whose (3, 3) corners turn counter-clockwise seen from outside, −1 for the others.

    Neighbors are made consistent; then each island is turned so that its volume is positive.
    """
    m = len(faces)
    rising = (faces < np.roll(faces, -1, axis=1)).ravel()
    edge = unique_edges(faces)[1].ravel()
    order = np.argsort(edge, kind="stable")
    same = np.flatnonzero(edge[order][1:] == edge[order][:-1])
    first, second = order[same], order[same + 1]
    a, b = first // 3, second // 3
    turned = rising[first] == rising[second]
    # Each face has a front (its own number) and a back (plus m); those of neighbors on one side of the surface connect.
    near, far = np.concatenate([a, a + m]), np.concatenate([np.where(turned, b + m, b), np.where(turned, b, b + m)])
    layer = connected_groups(np.stack([near, far], axis=1), 2 * m)
    sign = np.where(layer[:m] <= layer[m:], 1.0, -1.0)
    island = np.minimum(layer[:m], layer[m:])
    middle = corners.reshape(-1, 3).mean(axis=0)
    x, y, z = (corners[:, i] - middle for i in range(3))
    volume = np.bincount(island, weights=sign * np.einsum("ij,ij->i", x, np.cross(y, z)), minlength=2 * m)
    return np.asarray(np.where(volume[island] < 0, -sign, sign))


class Normals:
    """Outward normals at the vertices of a surface, averaged over lengths; each is computed once.

    Parameters
    ----------
    surface : Surface
        With n' vertices.
    flows : Flows
        On the surface.
    """

    def __init__(self, surface: Surface, flows: Flows) -> None:
        self._surface, self._flows = surface, flows
        self._smooth: dict[float, FloatArray] = {}

    @cached_property
    def signs(self) -> FloatArray:
        """(m',) 1 for each face of the surface that turns counter-clockwise seen from outside, −1 for others."""
        surface, original = self._surface, self._surface.original
        signs = outward_signs(surface.welded_faces, original.vertices[original.faces])
        return np.where(surface.face_of >= 0, signs[surface.face_of], 1.0)

    @cached_property
    def sharp(self) -> FloatArray:
        """(n', 3) unit normals that are not averaged."""
        mesh = self._surface.mesh
        corners = mesh.vertices[mesh.faces]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) * self.signs[:, None]
        return _normalized(indicator(mesh.faces.ravel(), mesh.n_vertices) @ np.repeat(normals, 3, axis=0))

    def over(self, length: float) -> FloatArray:
        """(n', 3) unit normals, averaged over a length of a few edges."""
        if length not in self._smooth:
            self._smooth[length] = _normalized(self._flows.short(length).smooth(self.sharp))
        return self._smooth[length]


def curvature_across(surface: Surface, normals: FloatArray, adjacency: FaceAdjacency) -> FloatArray:
    """(p,) curvature from one face to its neighbor, of a surface of area 1: negative in a crease, 3.5 on a sphere."""
    face_normals = _normalized(surface.to_faces(normals))
    centers = surface.to_faces(surface.mesh.vertices) / np.sqrt(surface.mesh.area)
    a, b = adjacency.pairs.T
    offset = centers[b] - centers[a]
    squared = np.maximum(np.einsum("ij,ij->i", offset, offset), LEAST_THICKNESS**2)
    return np.asarray(np.einsum("ij,ij->i", face_normals[b] - face_normals[a], offset) / squared)


def log_thickness(surface: Surface, normals: FloatArray, flows: Flows, progress: Progress | None = None) -> FloatArray:
    """(n',) logarithm of the radius of the largest inner ball that touches the surface at each vertex.

    In units of the square root of the area. By the shrinking ball of Ma, Bae and Choi (2012), against the tangent
    planes of the points that it touches, so that a thin sheet is recognized on a coarse mesh as well.
    """
    progress = Progress.of(progress)
    mesh = surface.mesh
    places = mesh.vertices / np.sqrt(mesh.area)
    stride = max(1, len(places) // MOST_BALLS)
    points, directions = places[::stride], normals[::stride]
    spacing = np.sqrt(2.3 / len(points))
    tree = cKDTree(points)
    radius = np.full(len(points), LARGEST_RADIUS)
    active = np.arange(len(points))
    for i in range(MAX_SHRINKS):
        p, n = points[active], directions[active]
        distance, nearest = np.empty(len(active)), np.empty(len(active), dtype=np.int64)
        for start in range(0, len(active), BALLS_AT_ONCE):
            # Each round is taken for half of the time that is left.
            progress(1 - 0.5**i * (1 - 0.5 * start / len(active)))
            rows = slice(start, start + BALLS_AT_ONCE)
            # From the middle of a ball all points are equally near, and an exact search would look at all of them.
            middles = p[rows] - radius[active[rows], None] * n[rows]
            distance[rows], nearest[rows] = tree.query(middles, eps=SEARCH_SLACK)
        inside = distance < radius[active] * (1 - 1e-4) - 1e-9
        active, nearest, p, n = active[inside], nearest[inside], p[inside], n[inside]
        if not len(active):
            break
        smaller, rough = _touching_balls(p, n, points[nearest], directions[nearest], spacing)
        active, smaller = active[~rough], smaller[~rough]
        radius[active] = np.minimum(smaller, radius[active])
    if stride > 1:
        radius = radius[tree.query(places)[1]]
    logs = np.log(radius + LEAST_THICKNESS)[:, None]
    return flows.short(THICKNESS_LENGTH).smooth(logs)[:, 0].astype(np.float64)


@dataclass(frozen=True)
class BorderShape:
    """What the shape of one pose says about the borders between its faces.

    Attributes
    ----------
    coarse, fine : (p,) arrays
        `curvature_across` the border of each pair of neighbors, without and with small details.
    thickness : (m,) array
        `log_thickness` of each face.
    """

    coarse: FloatArray
    fine: FloatArray
    thickness: FloatArray


def border_shape(
    surface: Surface,
    adjacency: FaceAdjacency,
    flows: Flows,
    normals: Normals,
    progress: Progress | None = None,
) -> BorderShape:
    """Curvature across the borders between neighbors, and thickness of the faces."""
    fine, coarse = normals.over(FINE), normals.over(COARSE)
    thickness = surface.to_faces(log_thickness(surface, fine, flows, progress)[:, None])[:, 0]
    return BorderShape(
        curvature_across(surface, coarse, adjacency), curvature_across(surface, fine, adjacency), thickness
    )


def weights_of_borders(
    pairs: IntArray, centers: FloatArray, curvature: FloatArray, thickness: FloatArray
) -> FloatArray:
    """(p,) weights of the borders between pairs of neighbors, 1 where the surface is flat and even.

    Parameters
    ----------
    pairs : (p, 2) int array
    centers : (m, 3) array
        Of the faces, for a surface of area 1.
    curvature : (p,) array
        Across each border.
    thickness : (m,) array
        Logarithm of the thickness of each face.
    """
    a, b = pairs.T
    distances = np.maximum(np.linalg.norm(centers[a] - centers[b], axis=1), LEAST_DISTANCE)
    step = np.minimum(np.abs(thickness[a] - thickness[b]) / distances, MOST_STEP)
    return np.asarray(np.exp(BORDER_CREASE * np.clip(curvature, -MOST_CONCAVE, MOST_CONVEX) - BORDER_STEP * step))


def _touching_balls(
    p: FloatArray, n: FloatArray, q: FloatArray, m: FloatArray, spacing: float
) -> tuple[FloatArray, BoolArray]:
    """Radius of the balls that touch p (normal n) and q (normal m), and whether q is only roughness beside p."""
    between = p - q
    along = np.einsum("ij,ij->i", between, n)
    radius = np.einsum("ij,ij->i", between, between) / np.maximum(2 * along, 1e-9)
    # The ball that touches the tangent plane at q, if it does so near q and the plane faces p.
    facing = np.einsum("ij,ij->i", n, m)
    planar = -np.einsum("ij,ij->i", between, m) / np.maximum(1 - facing, 1e-9)
    touch = p + planar[:, None] * (m - n)
    near = (facing < 0) & (planar > 0) & (np.einsum("ij,ij->i", touch - q, touch - q) < spacing**2)
    radius = np.where(near, np.minimum(planar, radius), radius)
    center = p - radius[:, None] * n
    cosine = np.einsum("ij,ij->i", _normalized(p - center), _normalized(np.where(near[:, None], touch, q) - center))
    return radius, np.asarray(cosine > ROUGHNESS_COSINE)


def _normalized(vectors: FloatArray) -> FloatArray:
    """(k, 3) vectors scaled to length 1."""
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=1), 1e-12)[:, None])
