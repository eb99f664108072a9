"""Borders that keep to the shape: labels as the minimum of an energy, in a narrow band around the borders.

The energy of Boykov, Veksler and Zabih, "Fast approximate energy minimization via graph cuts" (2001): what a label
costs on a face, by its posterior, and what a border costs, by its length, less where people cut (concave creases, the
minima rule of Hoffman and Richards 1984) and where the artist has marked edges. Minimized by their alpha expansion.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.csgraph import breadth_first_order, dijkstra, maximum_flow

from ..mesh.adjacency import FaceAdjacency
from ..mesh.surface import Surface
from ..mesh.triangle_mesh import BoolArray, FloatArray, IntArray
from .creases import COARSE, curvature_across, smooth_normals, vertex_normals
from .heat_flow import Flows

CREASE, MOST_CONCAVE, MOST_CONVEX = 0.05, 15.0, 0.0
"""Weight of a border by e to this times its curvature, which is taken between these bounds. Creases come and go with
the pose: at 0.4, which agrees best with people, segments are less the same in all poses …"""
STRENGTH = 2.0
"""What a border costs by its length, in units of the smoothing length. Less leaves borders where noise puts them."""
WIDTH = 1.0
"""How far a label may spread from the faces that have it, in units of the smoothing length."""
REGION_CREASE, REGION_WIDTH = 0.4, 2.0
"""… but regions, which are fewer, are not."""
LEAST_POSTERIOR = 1e-3
"""A posterior counts as no less than this: what is certain is no more certain than that."""
LARGEST = 2.0**29
"""Largest cost as a whole number. SciPy's flows are 32 bits wide, and what is left to flow back doubles it."""
TINY = 1e-200
"""What costs less than this costs nothing."""
SHORTEST = 1e-12
"""Distance between the centers of faces from which on they count as that far apart."""
SWEEPS = 5
"""Rounds over all labels at most. Two or three are usual."""


def crease_weights(surface: Surface, adjacency: FaceAdjacency, crease: float = CREASE) -> FloatArray:
    """(p,) weight of the border between neighbors among the original faces: 1 where flat or convex, less in creases.

    For `cut_borders`; where marked edges are to attract borders, to be multiplied by a number below 1 there.
    """
    return weights_of_curvature(coarse_curvature(surface, adjacency, Flows(surface.mesh)), crease)


def coarse_curvature(surface: Surface, adjacency: FaceAdjacency, flows: Flows) -> FloatArray:
    """(p,) curvature of a surface of area 1 from one original face to its neighbor, but for what is small."""
    return curvature_across(surface, smooth_normals(vertex_normals(surface), flows.over(COARSE)), adjacency)


def weights_of_curvature(curvature: FloatArray, crease: float = CREASE) -> FloatArray:
    """(p,) weight of borders across which a surface is curved, as `crease_weights` has it."""
    return np.asarray(np.exp(crease * np.clip(curvature, -MOST_CONCAVE, MOST_CONVEX)))


def cut_borders(
    posteriors: FloatArray,
    areas: FloatArray,
    centers: FloatArray,
    adjacency: FaceAdjacency,
    weights: FloatArray,
    length: float,
    labels: IntArray | None = None,
    strength: float = STRENGTH,
    width: float = WIDTH,
) -> IntArray:
    """Move the borders between labels, by no more than about a length, to where they are short and along creases.

    Each face keeps its label or takes one that is found nearby. The energy of the result is never above that of the
    labels it started with. Nothing is drawn at random.

    Parameters
    ----------
    posteriors : (m, K) array
        Of the labels, on each face; smoothed over `length`.
    areas : (m,) array
    centers : (m, 3) array
        In the unit whose square is that of the areas.
    adjacency : FaceAdjacency
        Its lengths in the same unit. Pairs may repeat, as of polygons that share several edges.
    weights : (p,) array
        What each border costs by its length, 1 where nothing speaks for one; not negative. See `crease_weights`.
    length : float
        Smoothing length, in units of the square root of the total area.
    labels : (m,) int array, optional
        To start from; -1: a face that takes no part. The likeliest of each face if not given.
    strength : float
        What a border costs, in units of `length`. 0 changes nothing if `labels` is not given.
    width : float
        How far labels may spread, in units of `length`. The center of a face counts, so nothing changes on a mesh that
        is coarser than that.

    Returns
    -------
    (m,) int array of labels.

    Raises
    ------
    ValueError
        If a weight is negative, or not a number.
    """
    if not (weights >= 0).all():
        raise ValueError("a weight of a border must not be negative")
    labels = np.asarray(posteriors.argmax(axis=1) if labels is None else labels)
    unit = np.sqrt(areas.sum())
    within = _labels_within(labels, posteriors.shape[1], centers, adjacency, width * length * unit)
    band = np.flatnonzero(within.any(axis=1))
    if not len(band):
        return labels.copy()
    number = _numbered(band, len(labels))
    # Outside the band nothing changes, but what touches it has a border with it.
    beside = (number[adjacency.pairs] >= 0).any(axis=1) & (labels[adjacency.pairs] >= 0).all(axis=1)
    pairs = adjacency.pairs[beside]
    rim = np.unique(pairs[number[pairs] < 0])
    number[rim] = len(band) + np.arange(len(rim))
    some = np.append(band, rim)
    data = -np.log(np.maximum(posteriors[some], LEAST_POSTERIOR)) * (areas[some] / unit**2)[:, None]
    borders = strength * length / unit * weights[beside] * adjacency.lengths[beside]
    energy = Energy.of(data, number[pairs], borders)
    cut = labels.copy()
    cut[some] = minimized(energy, labels[some], within[some])
    return cut


@dataclass(frozen=True)
class Energy:
    """What labels cost: a sum over nodes and over pairs of neighbors with different labels, in whole numbers.

    Attributes
    ----------
    data : (n, K) int array
        What each label costs at each node, not negative.
    pairs : (p, 2) int array
        Neighbors.
    borders : (p,) int array
        What it costs if they differ.
    """

    data: IntArray
    pairs: IntArray
    borders: IntArray

    @classmethod
    def of(cls, data: FloatArray, pairs: IntArray, borders: FloatArray) -> Energy:
        """Costs as whole numbers, as large as flows can hold."""
        # The flow through a node is at most what its label costs and all its borders.
        data = data - data.min(axis=1, keepdims=True)
        around = np.bincount(pairs.ravel(), weights=np.repeat(borders, 2), minlength=len(data))
        largest = float((data.max(axis=1) + 2 * around).max())
        scale = LARGEST / largest if largest > TINY else 0.0
        return cls(np.rint(data * scale).astype(np.int64), pairs, np.rint(borders * scale).astype(np.int64))

    def at(self, labels: IntArray) -> int:
        """The energy of (n,) labels."""
        differ = labels[self.pairs[:, 0]] != labels[self.pairs[:, 1]]
        return int(self.data[np.arange(len(labels)), labels].sum() + self.borders[differ].sum())


def minimized(energy: Energy, labels: IntArray, allowed: BoolArray) -> IntArray:
    """(n,) labels whose energy no expansion of one label lowers, if rounds suffice, and is not above that at first.

    Parameters
    ----------
    energy : Energy
    labels : (n,) int array
        To start from.
    allowed : (n, K) bool array
        Which labels each node may take, beside the one that it starts with.
    """
    labels, allowed = labels.copy(), allowed.copy()
    # Or what one label has taken, another could not take back.
    allowed[np.arange(len(labels)), labels] = True
    spreading = np.flatnonzero(allowed.any(axis=0))
    by_label = np.ascontiguousarray(allowed.T)
    touching = {label: np.flatnonzero(by_label[label][energy.pairs].any(axis=1)) for label in spreading}
    # A label need not be tried again until something has changed where it may spread, or beside that.
    untried = np.ones(allowed.shape[1], dtype=bool)
    for label in np.tile(spreading, SWEEPS):
        if not untried[label]:
            continue
        nodes = np.flatnonzero(by_label[label] & (labels != label))
        takes = expansion(energy, labels, int(label), nodes, touching[label])
        labels[takes] = label
        changed = np.zeros(len(labels), dtype=bool)
        changed[takes] = True
        around = energy.pairs[touching[label]]
        changed[around[changed[around].any(axis=1)]] = True
        untried |= allowed[changed].any(axis=0)
        untried[label] = False
    return labels


def expansion(energy: Energy, labels: IntArray, label: int, nodes: IntArray, touching: IntArray) -> IntArray:
    """Those of some nodes with other labels that take a label, so that the energy is as low as by that it can get.

    Section 5 of Boykov, Veksler and Zabih, without their auxiliary nodes (Kolmogorov and Zabih, "What energy functions
    can be minimized via graph cuts?", 2004). As few nodes as possible, so none if the energy does not fall.

    Parameters
    ----------
    energy : Energy
    labels : (n,) int array
        As they are.
    label : int
    nodes : (k,) int array
        Those that may take it.
    touching : (q,) int array
        Pairs of the energy, at least all of which one end is among the nodes.
    """
    n = len(nodes)
    number = _numbered(nodes, len(labels))
    # What it costs to take the label rather than keep one's own.
    gain = energy.data[nodes, label] - energy.data[nodes, labels[nodes]]
    pairs, cost = energy.pairs[touching], energy.borders[touching]
    a, b = number[pairs].T
    differ = labels[pairs[:, 0]] != labels[pairs[:, 1]]
    now = np.where(differ, cost, 0)
    for inside, outside, other in ((a, b, pairs[:, 1]), (b, a, pairs[:, 0])):
        fixed = (inside >= 0) & (outside < 0)
        then = np.where(labels[other] != label, cost, 0)
        gain += _sums(inside[fixed], (then - now)[fixed], n)
    both = (a >= 0) & (b >= 0)
    a, b, cost, now = a[both], b[both], cost[both], now[both]
    # With x = 1 for what takes the label, a pair costs: now + (cost − now) xa − cost xb + flow (1 − xa) xb.
    gain += _sums(a, cost - now, n) - _sums(b, cost, n)
    flow = 2 * cost - now
    source, sink = n, n + 1
    eager, loath = np.flatnonzero(gain < 0), np.flatnonzero(gain > 0)
    if not len(eager):
        return nodes[:0]
    rows = np.concatenate([np.full(len(eager), source), loath, b])
    columns = np.concatenate([eager, np.full(len(loath), sink), a])
    capacity = np.concatenate([-gain[eager], gain[loath], flow]).astype(np.int32)
    graph = csr_matrix(coo_matrix((capacity, (rows, columns)), shape=(n + 2,) * 2))
    left = graph - maximum_flow(graph, source, sink).flow
    left.eliminate_zeros()
    reached = breadth_first_order(left, source, return_predecessors=False)
    return np.asarray(nodes[np.sort(reached[reached < n])])


def _sums(owner: IntArray, values: IntArray, count: int) -> IntArray:
    """(count,) sums of whole numbers, each below 2⁵³: a float holds them exactly."""
    return np.bincount(owner, weights=values, minlength=count).astype(np.int64)


def _labels_within(
    labels: IntArray, count: int, centers: FloatArray, adjacency: FaceAdjacency, distance: float
) -> BoolArray:
    """(m, count) whether a face has another label than this one, but is no further than a distance from a face of it.

    By ways over the surface, from center to center.
    """
    m = len(labels)
    within = np.zeros((m, count), dtype=bool)
    pairs = adjacency.pairs[(labels[adjacency.pairs] >= 0).all(axis=1)]
    border = np.unique(pairs[labels[pairs[:, 0]] != labels[pairs[:, 1]]])
    if not len(border):
        return within
    ways = _ways(pairs, np.linalg.norm(centers[pairs[:, 0]] - centers[pairs[:, 1]], axis=1), m)
    near = np.flatnonzero(_distances(ways, border, distance) <= distance)
    number, ways = _numbered(near, m), ways[near][:, near]
    for label in np.unique(labels[border]):
        sources = number[border[labels[border] == label]]
        within[near, label] = _distances(ways, sources, distance) <= distance
    within[labels >= 0, labels[labels >= 0]] = False
    return within


def _ways(pairs: IntArray, lengths: FloatArray, count: int) -> csr_matrix:
    """(count, count) ways from one node to the next, there and back."""
    low, high = pairs.min(axis=1), pairs.max(axis=1)
    # Of repeated pairs the shortest counts, not the sum; a way of length 0 would be none.
    order = np.lexsort((lengths, high, low))
    low, high, lengths = low[order], high[order], np.maximum(lengths[order], SHORTEST)
    first = np.append(True, (np.diff(low) != 0) | (np.diff(high) != 0))
    graph = coo_matrix((lengths[first], (low[first], high[first])), shape=(count,) * 2).tocsr()
    return csr_matrix(graph + graph.T)


def _distances(ways: csr_matrix, sources: IntArray, most: float) -> FloatArray:
    """(n,) length of the shortest way from any source, infinite above `most`."""
    return np.asarray(dijkstra(ways, indices=sources, min_only=True, limit=most))


def _numbered(some: IntArray, count: int) -> IntArray:
    """(count,) place of each index among some of them, -1 for others."""
    number = np.full(count, -1)
    number[some] = np.arange(len(some))
    return number
