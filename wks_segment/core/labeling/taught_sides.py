"""Left and right of taught parts: which part of a pair is on the left, and in which half of a group each face lies."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..learning.taught_parts import TaughtParts
from ..mesh.adjacency import FaceAdjacency, connected_regions
from ..mesh.triangle_mesh import FloatArray, IntArray, TriangleMesh
from .sides import CLEAR_SIDE

UNKNOWN_SIDE = 2
"""Stands for the side of a region that shows neither a left nor a right part."""


def oriented(taught: TaughtParts, labels: IntArray, mesh: TriangleMesh, touching: FloatArray) -> TaughtParts:
    """The taught parts with those parts of pairs as `left` that lie on the left, which is +x.

    In a bent pose a right hand may lie on the left. So a pair that touches another one is oriented as that one; only of
    pairs that touch none, the one that is farthest apart is oriented by its place.

    Parameters
    ----------
    taught : TaughtParts
    labels : (m,) int array
        Taught part of each face, −1 for none. Pairs of which the mesh lacks a part stay as they are.
    mesh : TriangleMesh
        At rest if possible.
    touching : (parts, parts) array
        Length of the borders between parts on the mesh.
    """
    said = labels >= 0
    weights = mesh.face_areas[said] + np.finfo(float).tiny
    total = np.bincount(labels[said], weights, taught.n_parts)
    places = [np.bincount(labels[said], weights * axis, taught.n_parts) for axis in mesh.face_centers[said].T]
    centers = np.stack(places, axis=1) / np.where(total > 0, total, 1.0)[:, None]
    left, right = taught.left.copy(), taught.right.copy()
    open_groups = [g for g in taught.sided.tolist() if total[left[g]] > 0 and total[right[g]] > 0]
    done: list[int] = []
    while open_groups:
        pairs = [(g, h) for g in open_groups for h in done]
        borders = {pair: _sums(touching, left, right, *pair) for pair in pairs}
        g, h = max(pairs, key=lambda pair: _clearness(*borders[pair]), default=(-1, -1))
        if pairs and _clearness(*borders[g, h]) > 0:
            swap = borders[g, h][0] < borders[g, h][1]
        else:
            g = max(open_groups, key=lambda one: abs(float(centers[left[one], 0] - centers[right[one], 0])))
            swap = bool(centers[left[g], 0] < centers[right[g], 0])
        if swap:
            left[g], right[g] = right[g], left[g]
        open_groups.remove(g)
        done.append(g)
    return replace(taught, left=left, right=right)


def _clearness(straight: float, across: float) -> float:
    """How clearly two pairs lie on the same sides, or on opposite ones; 0 to 1."""
    return abs(straight - across) / max(straight + across, np.finfo(float).tiny)


def _sums(table: FloatArray, left: IntArray, right: IntArray, g: int, h: int) -> tuple[float, float]:
    """Sum of the values of two pairs of parts on the same sides, and across."""
    straight = table[left[g], left[h]] + table[right[g], right[h]]
    return float(straight), float(table[left[g], right[h]] + table[right[g], left[h]])


def sides_by_labels(region: IntArray, count: int, taught: TaughtParts, labels: IntArray, areas: FloatArray) -> IntArray:
    """(r,) side of each region by the taught left and right parts on it; `UNKNOWN_SIDE` if none is on it.

    Parameters
    ----------
    region : (m,) int array
        Region of each face.
    count : int
        r; higher numbers are of no region.
    taught : TaughtParts
        Oriented.
    labels, areas : (m,) arrays
        Taught part of each face, −1 for none; area of each face.
    """
    side_of_face = np.append(taught.side_of_part, 0)[labels]
    chosen = (side_of_face != 0) & (region < count)
    weight = np.bincount(region[chosen], areas[chosen], count)
    total = np.bincount(region[chosen], areas[chosen] * side_of_face[chosen], count)
    mean = total / np.where(weight > 0, weight, 1.0)
    clear = np.where(np.abs(mean) > CLEAR_SIDE, np.sign(mean), 0)
    return np.where(weight > 0, clear, UNKNOWN_SIDE).astype(np.int64)


def halves(field: FloatArray, labels: IntArray, neighbors: FaceAdjacency, areas: FloatArray) -> IntArray:
    """(p,) 1 for polygons on the left, −1 on the right: whole regions, but one that lies on both sides is halved.

    Parameters
    ----------
    field : (p,) array
        Mean of `side_field` over each polygon.
    labels : (p,) int array
        Group of each polygon, −1 for none.
    neighbors : FaceAdjacency
        Of the polygons.
    areas : (p,) array
    """
    region = connected_regions(labels, neighbors)
    count = int(region.max()) + 1
    weights = areas + np.finfo(float).tiny
    mean = np.bincount(region, weights * field, count) / np.bincount(region, weights, count)
    clear = np.abs(mean) > CLEAR_SIDE
    return np.where(np.where(clear, mean, 0.0)[region] + np.where(clear[region], 0.0, field) < 0, -1, 1)
