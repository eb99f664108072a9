"""Ties between the islands of one character where they meet, so that they share one spectrum.

Without ties each island has a zero mode of its own, and its eigenfunctions do not depend on where it sits: similar
islands get the same label everywhere. The ties follow a minimum spanning tree of the islands and so add no shortcut: an
arm is tied to its shoulder, not to the hip on which the hand happens to rest.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from .triangle_mesh import FloatArray, IntArray, TriangleMesh, islands_of_vertices

CONTACT_REACH = 0.01
"""Two islands are tied at all vertices whose distance exceeds the shortest distance by no more than this, in units of
the square root of the area."""
LEAST_CONTACT_SHARE = 0.1
"""Least share of the vertices of the newer island that are tied: a single tie would be a hinge without width."""


def ties_between_islands(faces: IntArray, *poses: FloatArray) -> IntArray:
    """(t, 2) pairs of vertices that tie all islands of a mesh together, each to the nearest one (Prim, 1957).

    The tree starts at the largest island and always adds the island nearest to it.

    Parameters
    ----------
    faces : (m, 3) int array
    poses : (n, 3) arrays
        Positions of the vertices in each pose. Distances are root mean squares over the poses, so that islands are tied
        at their joints and not where they meet by chance.
    """
    label = islands_of_vertices(faces, len(poses[0]))
    if (label[faces[:, 0]] == label[faces[0, 0]]).all():
        return np.zeros((0, 2), dtype=np.int64)
    surface = TriangleMesh(poses[0], faces)
    used = np.unique(faces)
    island = np.full(surface.n_vertices, -1)
    island[used] = np.unique(label[used], return_inverse=True)[1]
    count = int(island.max()) + 1
    # A distance between these places is the root mean square of the distances in the poses.
    places = np.concatenate(poses, axis=1) / np.sqrt(len(poses))
    order = np.argsort(island, kind="stable")
    members = np.split(order, np.cumsum(np.bincount(island + 1))[:-1])[1:]
    areas = np.bincount(island[used], weights=surface.vertex_areas[used])
    distance, nearest = np.full(len(places), np.inf), np.zeros(len(places), dtype=np.int64)
    outside = island >= 0
    reach = CONTACT_REACH * np.sqrt(surface.area)
    ties = []
    newest = int(areas.argmax())
    for _ in range(count - 1):
        added = members[newest]
        outside[added] = False
        remaining = np.flatnonzero(outside)
        low, high = places[added].min(axis=0), places[added].max(axis=0)
        beyond = np.maximum(np.maximum(low - places[remaining], places[remaining] - high), 0)
        remaining = remaining[np.einsum("ij,ij->i", beyond, beyond) < distance[remaining] ** 2]
        new_distance, index = cKDTree(places[added]).query(places[remaining])
        closer = new_distance < distance[remaining]
        distance[remaining[closer]] = new_distance[closer]
        nearest[remaining[closer]] = added[index[closer]]
        first = int(np.argmin(np.where(outside, distance, np.inf)))
        newest = int(island[first])
        ties.append(_contact_pairs(places, members[newest], members[island[nearest[first]]], reach))
    return np.concatenate(ties)


def _contact_pairs(places: FloatArray, vertices: IntArray, others: IntArray, reach: float) -> IntArray:
    """(t, 2) vertices of an island that are near to another island, each with its nearest vertex there."""
    distance, index = cKDTree(places[others]).query(places[vertices])
    tied = distance <= max(distance.min() + reach, float(np.quantile(distance, LEAST_CONTACT_SHARE)))
    return np.stack([vertices[tied], others[index[tied]]], axis=1)
