"""What a surface looks like from outside: which way it faces, where it is concave, how thick the body under it is.

Not invariant to bending as the signature is, but what people go by when they cut a shape into parts: they cut along
concave creases (the minima rule, Hoffman and Richards 1984) and where the thickness changes (Shapira, Shamir and
Cohen-Or 2008).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from ..mesh.adjacency import FaceAdjacency
from ..mesh.surface import Surface, indicator
from ..mesh.triangle_mesh import BoolArray, FloatArray, IntArray, unique_edges
from .heat_flow import Flows, HeatFlow

FINE, COARSE = 0.012, 0.02
"""Widths over which normals are averaged, in units of the square root of the area: what is smaller is no crease."""
THICKNESS_LENGTH = 0.01
"""Width over which thickness is averaged, in the same unit."""
WIDEST = 0.6
"""Radius from which balls shrink, in the same unit; a sphere's is 0.28."""
ROUNDS = 30
"""Rounds of shrinking at most. Five are usual."""
NOISE = 0.5
"""Cosine of the angle between the two places where a ball touches, from which on it is the surface's own roughness."""
SLACK = 0.01
"""How much further than the nearest place the one may be that is found, as a fraction."""
MOST_BALLS = 20_000
"""Vertices at which thickness is measured; others take it from the nearest of these."""
AT_ONCE = 2_000
"""Balls between two reports of progress."""
CREASE, MOST_CONCAVE, MOST_CONVEX = 0.4, 15.0, 2.0
"""Weight of a border by e to this times its curvature, which is taken between these bounds."""
STEP, MOST_STEP = 0.1, 40.0
"""Weight of a border by e to minus this times the change of log thickness over the unit of length, bounded."""
SHORTEST = 3e-3
"""Distance between faces from which on changes count as changes over that distance."""
FLAT = 0.003
"""Added to thickness before its logarithm, in units of the square root of the area: a sheet has none."""


def outward(faces: IntArray, corners: FloatArray) -> FloatArray:
    """(m,) +1 for each face whose (3, 3) corners turn counter-clockwise seen from outside, −1 for others.

    Neighbors are made to agree, then the larger side of each loose part is taken for the inside.
    """
    m = len(faces)
    rising = (faces < np.roll(faces, -1, axis=1)).ravel()
    edge = unique_edges(faces)[1].ravel()
    order = np.argsort(edge, kind="stable")
    same = np.flatnonzero(edge[order][1:] == edge[order][:-1])
    first, second = order[same], order[same + 1]
    a, b = first // 3, second // 3
    turned = rising[first] == rising[second]
    # Each face has two sides; sides of neighbors that look the same way hang together.
    rows, columns = np.concatenate([a, a + m]), np.concatenate([np.where(turned, b + m, b), np.where(turned, b, b + m)])
    graph = coo_matrix((np.ones(2 * len(a), dtype=np.int8), (rows, columns)), shape=(2 * m,) * 2)
    side = connected_components(graph, directed=False)[1]
    sign = np.where(side[:m] <= side[m:], 1.0, -1.0)
    part = np.minimum(side[:m], side[m:])
    middle = corners.reshape(-1, 3).mean(axis=0)
    x, y, z = (corners[:, i] - middle for i in range(3))
    volume = np.bincount(part, weights=sign * np.einsum("ij,ij->i", x, np.cross(y, z)), minlength=2 * m)
    return np.asarray(np.where(volume[part] < 0, -sign, sign))


def vertex_normals(surface: Surface) -> FloatArray:
    """(n', 3) unit normals at the vertices of a surface, outward."""
    mesh, original = surface.mesh, surface.original
    corners = mesh.vertices[mesh.faces]
    of_faces = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    sign = outward(surface.welded_faces, original.vertices[original.faces])
    of_faces *= np.where(surface.face_of >= 0, sign[surface.face_of], 1.0)[:, None]
    return _unit(indicator(mesh.faces.ravel(), mesh.n_vertices) @ np.repeat(of_faces, 3, axis=0))


def smooth_normals(normals: FloatArray, flow: HeatFlow) -> FloatArray:
    """(n', 3) unit normals, averaged by a flow over the surface."""
    return _unit(flow.smooth(normals).astype(np.float64))


def curvature_across(surface: Surface, normals: FloatArray, adjacency: FaceAdjacency) -> FloatArray:
    """(p,) curvature of a surface of area 1 from one face to its neighbor: negative in a crease, 3.5 on a sphere."""
    original = surface.original
    of_faces = _unit(surface.to_faces(normals))
    centers = original.vertices[original.faces].mean(axis=1) / np.sqrt(original.area)
    a, b = adjacency.pairs.T
    step = centers[b] - centers[a]
    squared = np.maximum(np.einsum("ij,ij->i", step, step), FLAT**2)
    return np.asarray(np.einsum("ij,ij->i", of_faces[b] - of_faces[a], step) / squared)


def log_thickness(
    surface: Surface, normals: FloatArray, flows: Flows, tick: Callable[[float], None] | None = None
) -> FloatArray:
    """(n',) logarithm of the radius of the largest ball that touches a surface of area 1 at a vertex from inside.

    By the shrinking ball of Ma, Bae and Choi (2012), against the tangent planes of what it touches, so that a thin
    sheet is seen on a coarse mesh too. `tick` is called with the share that is done, about.
    """
    mesh = surface.mesh
    places = mesh.vertices / np.sqrt(mesh.area)
    step = max(1, len(places) // MOST_BALLS)
    points, directions = places[::step], normals[::step]
    spacing = np.sqrt(2.3 / len(points))
    tree = cKDTree(points)
    radius = np.full(len(points), WIDEST)
    active = np.arange(len(points))
    for i in range(ROUNDS):
        p, n = points[active], directions[active]
        distance, nearest = np.empty(len(active)), np.empty(len(active), dtype=np.int64)
        for begun in range(0, len(active), AT_ONCE):
            if tick:
                tick(1 - 0.5**i * (1 - 0.5 * begun / len(active)))
            some = slice(begun, begun + AT_ONCE)
            # From the middle of a ball everything is equally near, and the exact search would look at all of it.
            distance[some], nearest[some] = tree.query(p[some] - radius[active[some], None] * n[some], eps=SLACK)
        inside = distance < radius[active] * (1 - 1e-4) - 1e-9
        active, nearest, p, n = active[inside], nearest[inside], p[inside], n[inside]
        if not len(active):
            break
        smaller, rough = _touching(p, n, points[nearest], directions[nearest], spacing)
        active, smaller = active[~rough], smaller[~rough]
        radius[active] = np.minimum(smaller, radius[active])
    if step > 1:
        radius = radius[tree.query(places)[1]]
    logs = np.log(radius + FLAT)[:, None]
    return flows.over(THICKNESS_LENGTH).smooth(logs)[:, 0].astype(np.float64)


def border_weights(
    surface: Surface, adjacency: FaceAdjacency, tick: Callable[[float], None] | None = None
) -> tuple[FloatArray, FloatArray]:
    """(p,) weight of the border between neighbors, 1 where nothing speaks for a cut, and the fine curvature there.

    `tick` is called with the share that is done.
    """
    original = surface.original
    normals, flows = vertex_normals(surface), Flows(surface.mesh)
    fine, coarse = (smooth_normals(normals, flows.over(length)) for length in (FINE, COARSE))
    thickness = surface.to_faces(log_thickness(surface, fine, flows, tick)[:, None])[:, 0]
    curvature = curvature_across(surface, coarse, adjacency)
    centers = original.vertices[original.faces].mean(axis=1) / np.sqrt(original.area)
    a, b = adjacency.pairs.T
    distances = np.maximum(np.linalg.norm(centers[a] - centers[b], axis=1), SHORTEST)
    step = np.minimum(np.abs(thickness[a] - thickness[b]) / distances, MOST_STEP)
    weights = np.exp(CREASE * np.clip(curvature, -MOST_CONCAVE, MOST_CONVEX) - STEP * step)
    return weights, curvature_across(surface, fine, adjacency)


def _touching(
    p: FloatArray, n: FloatArray, q: FloatArray, m: FloatArray, spacing: float
) -> tuple[FloatArray, BoolArray]:
    """Radius of the balls that touch p (normal n) and q (normal m), and whether q is only roughness beside p."""
    between = p - q
    along = np.einsum("ij,ij->i", between, n)
    radius = np.einsum("ij,ij->i", between, between) / np.maximum(2 * along, 1e-9)
    # The ball that touches the plane at q, where that is near to q and faces p.
    facing = np.einsum("ij,ij->i", n, m)
    flat = -np.einsum("ij,ij->i", between, m) / np.maximum(1 - facing, 1e-9)
    touch = p + flat[:, None] * (m - n)
    near = (facing < 0) & (flat > 0) & (np.einsum("ij,ij->i", touch - q, touch - q) < spacing**2)
    radius = np.where(near, np.minimum(flat, radius), radius)
    center = p - radius[:, None] * n
    cosine = np.einsum("ij,ij->i", _unit(p - center), _unit(np.where(near[:, None], touch, q) - center))
    return radius, np.asarray(cosine > NOISE)


def _unit(vectors: FloatArray) -> FloatArray:
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=1), 1e-12)[:, None])
