"""Left and right of taught parts: which part of a pair is on the left, and which half of a group each face belongs to."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..learning.taught_parts import TaughtParts
from ..mesh.adjacency import FaceAdjacency, connected_regions
from ..mesh.triangle_mesh import FloatArray, IntArray, TriangleMesh
from .sides import CLEAR_SIDE
from .traits import Traits

UNKNOWN_SIDE = 2
"""Stands for the side of a region that shows neither a left nor a right part."""


def oriented(taught: TaughtParts, labels: IntArray, mesh: TriangleMesh) -> TaughtParts:
    """The taught parts with those parts of pairs as `left` that lie on the left, which is +x.

    In a bent pose a right hand may lie on the left. So only the pair that is farthest apart is oriented by its place,
    and every other one by the nearest pair that is oriented already: a hand is nearest to the forearm of its own arm.

    Parameters
    ----------
    taught : TaughtParts
    labels : (m,) int array
        Taught part of each face, −1 for none. Pairs of which the mesh lacks a part stay as they are.
    mesh : TriangleMesh
        At rest if possible.
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
        if done:
            _, g, h = min((min(_distances(centers, left, right, g, h)), g, h) for g in open_groups for h in done)
            straight, across = _distances(centers, left, right, g, h)
            swap = across < straight
        else:
            g = max(open_groups, key=lambda one: abs(float(centers[left[one], 0] - centers[right[one], 0])))
            swap = bool(centers[left[g], 0] < centers[right[g], 0])
        if swap:
            left[g], right[g] = right[g], left[g]
        open_groups.remove(g)
        done.append(g)
    return replace(taught, left=left, right=right)


def _distances(centers: FloatArray, left: IntArray, right: IntArray, g: int, h: int) -> tuple[float, float]:
    """Sum of the distances of two pairs on the same sides, and across."""
    a, b, c, d = centers[left[g]], centers[right[g]], centers[left[h]], centers[right[h]]
    straight = np.linalg.norm(a - c) + np.linalg.norm(b - d)
    return float(straight), float(np.linalg.norm(a - d) + np.linalg.norm(b - c))


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


def consistent(numbers: IntArray, found: Traits, known: Traits, side: IntArray, noise: FloatArray) -> IntArray:
    """(r',) numbers of found regions, with left and right exchanged where all regions together are then more alike.

    A single region of another body has a weak handedness: one that is matched with the wrong side draws others after
    it. So segments are exchanged one by one, from the numbers as they are and from all exchanged, and the better result
    is taken.

    Parameters
    ----------
    numbers : (r',) int array
        Known region of each found one; r and more for none.
    found, known : Traits
    side : (r,) int array
        Of the known regions.
    noise : (4,) array
        Standard deviations of log area, signature, handedness and distance.
    """
    partner = np.arange(len(side))
    for i in np.flatnonzero(side):
        others = np.flatnonzero((known.segment == known.segment[i]) & (side == -side[i]))
        if len(others):
            partner[i] = others[np.abs(np.log(known.area[others] / known.area[i])).argmin()]
    matched = np.flatnonzero(numbers < len(side))
    segments = [s for s in np.unique(found.segment[matched]).tolist() if (side[known.segment == s] != 0).any()]
    weight = found.area[matched] / found.area[matched].sum()
    distance = found.distance[np.ix_(matched, matched)]

    def with_exchanged(exchanged: frozenset[int]) -> IntArray:
        at = numbers[matched]
        return np.where(np.isin(found.segment[matched], list(exchanged)), partner[at], at)

    def cost(exchanged: frozenset[int]) -> float:
        at = with_exchanged(exchanged)
        hands = ((found.handedness[matched] - known.handedness[at]) / noise[2]) ** 2
        apart = ((distance - known.distance[np.ix_(at, at)]) / noise[3]) ** 2 @ weight
        return float(hands.sum() + np.sqrt(len(matched)) * apart.sum())

    best = frozenset[int]()
    for start in (best, frozenset(segments)):
        now, lowest = start, cost(start)
        while segments:
            options = {now ^ {s}: cost(now ^ {s}) for s in segments}
            option = min(options, key=options.__getitem__)
            if not options[option] < lowest:
                break
            now, lowest = option, options[option]
        best = now if lowest < cost(best) else best
    result = numbers.copy()
    result[matched] = with_exchanged(best)
    return result


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
