"""Loose parts of one character, tied to each other where they meet, so that they share one spectrum.

Without, each of n parts has a zero mode, and its functions say nothing of where it sits: alike parts get one label
wherever they are. A minimum spanning tree of the parts adds no shortcut: an arm is tied to its shoulder, not to the hip
that the hand happens to rest on.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from .triangle_mesh import FloatArray, IntArray, TriangleMesh, components_of

CONTACT = 0.01
"""Parts are tied where they are no further apart than where they are nearest, and this much more, in units of the
square root of the area …"""
LEAST_CONTACT = 0.1
"""… but over this share of the newer part's vertices at least: a single link would be a hinge of no width."""


def ties_between_pieces(faces: IntArray, *poses: FloatArray) -> IntArray:
    """(t, 2) pairs of vertices that tie all loose parts of a mesh together, each part to the nearest one (Prim, 1957).

    The largest part comes first, then always the one that is nearest to those that are there.

    Parameters
    ----------
    faces : (m, 3) int array
    poses : (n, 3) arrays
        Positions of the vertices in each pose. Distances are root mean squares over the poses, so that parts are tied
        at their joints and not where they meet by chance.
    """
    label = components_of(faces, len(poses[0]))
    if (label[faces[:, 0]] == label[faces[0, 0]]).all():
        return np.zeros((0, 2), dtype=np.int64)
    surface = TriangleMesh(poses[0], faces)
    used = np.unique(faces)
    piece = np.full(surface.n_vertices, -1)
    piece[used] = np.unique(label[used], return_inverse=True)[1]
    count = int(piece.max()) + 1
    # A distance in this space is the root mean square of those in the poses.
    places = np.concatenate(poses, axis=1) / np.sqrt(len(poses))
    order = np.argsort(piece, kind="stable")
    members = np.split(order, np.cumsum(np.bincount(piece + 1))[:-1])[1:]
    areas = np.bincount(piece[used], weights=surface.vertex_areas[used])
    distance, nearest = np.full(len(places), np.inf), np.zeros(len(places), dtype=np.int64)
    outside = piece >= 0
    reach = CONTACT * np.sqrt(surface.area)
    ties = []
    newest = int(areas.argmax())
    for _ in range(count - 1):
        here = members[newest]
        outside[here] = False
        waiting = np.flatnonzero(outside)
        low, high = places[here].min(axis=0), places[here].max(axis=0)
        beyond = np.maximum(np.maximum(low - places[waiting], places[waiting] - high), 0)
        waiting = waiting[np.einsum("ij,ij->i", beyond, beyond) < distance[waiting] ** 2]
        found, which = cKDTree(places[here]).query(places[waiting])
        closer = found < distance[waiting]
        distance[waiting[closer]], nearest[waiting[closer]] = found[closer], here[which[closer]]
        first = int(np.argmin(np.where(outside, distance, np.inf)))
        newest = int(piece[first])
        ties.append(_contact(places, members[newest], members[piece[nearest[first]]], reach))
    return np.concatenate(ties)


def _contact(places: FloatArray, part: IntArray, other: IntArray, reach: float) -> IntArray:
    """(t, 2) vertices of a part that are near to another one, each with its nearest vertex there."""
    distance, which = cKDTree(places[other]).query(places[part])
    tied = distance <= max(distance.min() + reach, float(np.quantile(distance, LEAST_CONTACT)))
    return np.stack([part[tied], other[which[tied]]], axis=1)
