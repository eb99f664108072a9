"""Borders that follow the shape: labels of least energy, in a narrow band around the borders that are there.

The energy of Boykov, Veksler and Zabih, "Fast approximate energy minimization via graph cuts" (2001), is the cost of
the labels of the faces, by their posteriors, and of the borders, by their lengths. Borders cost less where people cut
(concave creases, the minima rule of Hoffman and Richards 1984) and where the user has marked edges. Their alpha
expansion minimizes it.

The expansion is ours, since SciPy has the maximum flow but no energies of labels; it builds the graph of each move
without the auxiliary nodes of the paper, and the band keeps that graph small.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.csgraph import breadth_first_order, dijkstra, maximum_flow

from ..mesh.adjacency import FaceGraph
from ..mesh.triangle_mesh import BoolArray, FloatArray, IntArray

CUT_CREASE, CUT_MOST_CONCAVE, CUT_MOST_CONVEX = 0.05, 15.0, 0.0
"""A border is weighted by `exp(CUT_CREASE * clip(curvature, -CUT_MOST_CONCAVE, CUT_MOST_CONVEX))`. A crease weight of
0.4 agrees best with people, but creases come and go with the pose, so that segments would differ between poses ("then
borders cut" in docs/dev/experiments.md)."""
CUT_STRENGTH = 2.0
"""Cost of a border by its length, in units of the smoothing length (same table). Below, borders stay where noise puts
them."""
CUT_WIDTH = 1.0
"""Distance that a label may spread from the faces that have it, in units of the smoothing length."""
REGION_CREASE, REGION_WIDTH = 0.4, 2.0
"""Crease weight and width for cutting regions. There are few of them, and they stay the same between poses also
with the crease weight that agrees best with people."""
LEAST_POSTERIOR = 1e-3
"""Least posterior in the energy: a label of posterior 0 must not cost infinitely much."""
LARGEST_COST = 2.0**29
"""Largest cost as an integer. SciPy's flows have 32 bits, and the residual capacity can be twice the cost."""
TINY_ENERGY = 1e-200
"""Energies below this count as 0, since they cannot be scaled up to `LARGEST_COST`."""
SHORTEST_PATH = 1e-12
"""Least length of the path between neighboring faces, because an entry of 0 would mean that there is none."""
MAX_SWEEPS = 5
"""Most rounds over all labels. Two or three are usual."""


@dataclass(frozen=True)
class CutStyle:
    """Settings of a cut.

    Attributes
    ----------
    length : float
        Smoothing length, in units of the square root of the total area.
    crease : float
        How much creases attract borders; see `CUT_CREASE`.
    width : float
        Distance that labels may spread, in units of `length`. It is measured between centers of faces, so that nothing
        changes on a mesh whose faces are farther apart.
    strength : float
        Cost of a border by its length, in units of `length`. With 0, the labels at the start stay.
    """

    length: float
    crease: float = CUT_CREASE
    width: float = CUT_WIDTH
    strength: float = CUT_STRENGTH

    def border_weights(self, curvature: FloatArray) -> FloatArray:
        """(p,) weights of borders, given the curvature across them: 1 where flat or convex, less in creases.

        Where marked edges are to attract borders, multiply the weights there by a number below 1.
        """
        return np.asarray(np.exp(self.crease * np.clip(curvature, -CUT_MOST_CONCAVE, CUT_MOST_CONVEX)))


def cut_borders(
    posteriors: FloatArray, graph: FaceGraph, weights: FloatArray, style: CutStyle, labels: IntArray | None = None
) -> IntArray:
    """Move the borders between labels, by about `style.width` at most, to where they are short and along creases.

    Each face keeps its label or takes one that occurs nearby. The energy never rises above that of the labels at the
    start. The result does not depend on a random seed.

    Parameters
    ----------
    posteriors : (m, K) array
        Posteriors of the labels on each face, smoothed over `style.length`.
    graph : FaceGraph
        The m faces.
    weights : (p,) array
        Cost of each border by its length, at least 0; see `CutStyle.border_weights`.
    style : CutStyle
    labels : (m,) int array, optional
        Labels at the start; -1: a face without a label, which keeps none. The most likely label of each face if not
        given.

    Returns
    -------
    (m,) int array of labels.

    Raises
    ------
    ValueError
        If a weight is negative or not a number.
    """
    if not (weights >= 0).all():
        raise ValueError("the weights of borders must not be negative")
    areas, adjacency = graph.areas, graph.adjacency
    labels = np.asarray(posteriors.argmax(axis=1) if labels is None else labels)
    unit = np.sqrt(areas.sum())
    within = _labels_within(labels, posteriors.shape[1], graph, style.width * style.length * unit)
    band = np.flatnonzero(within.any(axis=1))
    if not len(band):
        return labels.copy()
    node = _index_in(band, len(labels))
    # Labels outside the band do not change, but faces there that touch the band have borders with it.
    touching = (node[adjacency.pairs] >= 0).any(axis=1) & (labels[adjacency.pairs] >= 0).all(axis=1)
    pairs = adjacency.pairs[touching]
    rim = np.unique(pairs[node[pairs] < 0])
    node[rim] = len(band) + np.arange(len(rim))
    faces = np.append(band, rim)
    data = -np.log(np.maximum(posteriors[faces], LEAST_POSTERIOR)) * (areas[faces] / unit**2)[:, None]
    borders = style.strength * style.length / unit * weights[touching] * adjacency.lengths[touching]
    energy = Energy.of(data, node[pairs], borders)
    result = labels.copy()
    result[faces] = minimize_energy(energy, labels[faces], within[faces])
    return result


@dataclass(frozen=True)
class Energy:
    """Energy of a labeling: a sum over nodes, and over pairs of neighbors with different labels, in integers.

    Attributes
    ----------
    data : (n, K) int array
        Cost of each label at each node, at least 0.
    pairs : (p, 2) int array
        Neighbors.
    borders : (p,) int array
        Cost of different labels on the two.
    """

    data: IntArray
    pairs: IntArray
    borders: IntArray

    @classmethod
    def of(cls, data: FloatArray, pairs: IntArray, borders: FloatArray) -> Energy:
        """Energy with the given costs, scaled to integers as large as flows can hold."""
        # The flow through a node is at most the cost of its label and of all its borders.
        data = data - data.min(axis=1, keepdims=True)
        around = np.bincount(pairs.ravel(), weights=np.repeat(borders, 2), minlength=len(data))
        largest = float((data.max(axis=1) + 2 * around).max())
        scale = LARGEST_COST / largest if largest > TINY_ENERGY else 0.0
        return cls(np.rint(data * scale).astype(np.int64), pairs, np.rint(borders * scale).astype(np.int64))

    def at(self, labels: IntArray) -> int:
        """Energy of (n,) labels."""
        differ = labels[self.pairs[:, 0]] != labels[self.pairs[:, 1]]
        return int(self.data[np.arange(len(labels)), labels].sum() + self.borders[differ].sum())


def minimize_energy(energy: Energy, labels: IntArray, allowed: BoolArray) -> IntArray:
    """(n,) labels whose energy is at most that of the labels at the start, by alpha expansion.

    After fewer than `MAX_SWEEPS` rounds no expansion of a single label lowers the energy further.

    Parameters
    ----------
    energy : Energy
    labels : (n,) int array
        Labels at the start.
    allowed : (n, K) bool array
        Labels that each node may take, besides the one at the start.
    """
    labels, allowed = labels.copy(), allowed.copy()
    # A node may always go back to its first label.
    allowed[np.arange(len(labels)), labels] = True
    spreading = np.flatnonzero(allowed.any(axis=0))
    by_label = np.ascontiguousarray(allowed.T)
    touching = {label: np.flatnonzero(by_label[label][energy.pairs].any(axis=1)) for label in spreading}
    # A label is tried again only after a change where it may spread, or next to there.
    untried = np.ones(allowed.shape[1], dtype=bool)
    for label in np.tile(spreading, MAX_SWEEPS):
        if not untried[label]:
            continue
        nodes = np.flatnonzero(by_label[label] & (labels != label))
        switching = expansion(energy, labels, int(label), nodes, touching[label])
        labels[switching] = label
        changed = np.zeros(len(labels), dtype=bool)
        changed[switching] = True
        around = energy.pairs[touching[label]]
        changed[around[changed[around].any(axis=1)]] = True
        untried |= allowed[changed].any(axis=0)
        untried[label] = False
    return labels


def expansion(energy: Energy, labels: IntArray, label: int, nodes: IntArray, touching: IntArray) -> IntArray:
    """Nodes that switch to `label` in the optimal expansion move.

    Section 5 of Boykov, Veksler and Zabih, without their auxiliary nodes (Kolmogorov and Zabih, "What energy functions
    can be minimized via graph cuts?", 2004). Of several optimal moves it is the one with the fewest nodes, so that none
    switches if the energy does not fall.

    Parameters
    ----------
    energy : Energy
    labels : (n,) int array
        Labels before the move.
    label : int
    nodes : (k,) int array
        Nodes with other labels that may switch.
    touching : (q,) int array
        Indices of pairs of the energy; among them all pairs with an end in `nodes`.
    """
    n = len(nodes)
    index = _index_in(nodes, len(labels))
    # Cost of switching, instead of keeping the label.
    gain = energy.data[nodes, label] - energy.data[nodes, labels[nodes]]
    pairs, cost = energy.pairs[touching], energy.borders[touching]
    a, b = index[pairs].T
    differ = labels[pairs[:, 0]] != labels[pairs[:, 1]]
    before = np.where(differ, cost, 0)
    for inside, outside, neighbor in ((a, b, pairs[:, 1]), (b, a, pairs[:, 0])):
        fixed = (inside >= 0) & (outside < 0)
        after = np.where(labels[neighbor] != label, cost, 0)
        gain += _integer_sums(inside[fixed], (after - before)[fixed], n)
    both = (a >= 0) & (b >= 0)
    a, b, cost, before = a[both], b[both], cost[both], before[both]
    # With x = 1 for a node that switches, a pair costs: before + (cost − before) xa − cost xb + flow (1 − xa) xb.
    gain += _integer_sums(a, cost - before, n) - _integer_sums(b, cost, n)
    flow = 2 * cost - before
    source, sink = n, n + 1
    eager, reluctant = np.flatnonzero(gain < 0), np.flatnonzero(gain > 0)
    if not len(eager):
        return nodes[:0]
    rows = np.concatenate([np.full(len(eager), source), reluctant, b])
    columns = np.concatenate([eager, np.full(len(reluctant), sink), a])
    capacity = np.concatenate([-gain[eager], gain[reluctant], flow]).astype(np.int32)
    network = csr_matrix(coo_matrix((capacity, (rows, columns)), shape=(n + 2,) * 2))
    residual = network - maximum_flow(network, source, sink).flow
    residual.eliminate_zeros()
    reached = breadth_first_order(residual, source, return_predecessors=False)
    return np.asarray(nodes[np.sort(reached[reached < n])])


def _integer_sums(owner: IntArray, values: IntArray, count: int) -> IntArray:
    """(count,) sums of integers by owner; exact, as long as they stay below 2⁵³."""
    return np.bincount(owner, weights=values, minlength=count).astype(np.int64)


def _labels_within(labels: IntArray, count: int, graph: FaceGraph, distance: float) -> BoolArray:
    """(m, count) whether a face with another label is within a distance of a face with this label.

    Distances are lengths of paths over the surface, from center to center.
    """
    m, adjacency, centers = len(labels), graph.adjacency, graph.centers
    within = np.zeros((m, count), dtype=bool)
    pairs = adjacency.pairs[(labels[adjacency.pairs] >= 0).all(axis=1)]
    border = np.unique(pairs[labels[pairs[:, 0]] != labels[pairs[:, 1]]])
    if not len(border):
        return within
    paths = _path_graph(pairs, np.linalg.norm(centers[pairs[:, 0]] - centers[pairs[:, 1]], axis=1), m)
    near = np.flatnonzero(_distances(paths, border, distance) <= distance)
    index, paths = _index_in(near, m), paths[near][:, near]
    for label in np.unique(labels[border]):
        sources = index[border[labels[border] == label]]
        within[near, label] = _distances(paths, sources, distance) <= distance
    within[labels >= 0, labels[labels >= 0]] = False
    return within


def _path_graph(pairs: IntArray, lengths: FloatArray, count: int) -> csr_matrix:
    """(count, count) symmetric matrix of the lengths of the paths between neighboring nodes."""
    low, high = pairs.min(axis=1), pairs.max(axis=1)
    # A sparse matrix would add the lengths of a pair that occurs several times; only the shortest counts.
    order = np.lexsort((lengths, high, low))
    low, high, lengths = low[order], high[order], np.maximum(lengths[order], SHORTEST_PATH)
    first = np.append(True, (np.diff(low) != 0) | (np.diff(high) != 0))
    half = coo_matrix((lengths[first], (low[first], high[first])), shape=(count,) * 2).tocsr()
    return csr_matrix(half + half.T)


def _distances(paths: csr_matrix, sources: IntArray, limit: float) -> FloatArray:
    """(n,) length of the shortest path from any source, infinite above a limit."""
    return np.asarray(dijkstra(paths, indices=sources, min_only=True, limit=limit))


def _index_in(subset: IntArray, count: int) -> IntArray:
    """(count,) index of each number in a subset of 0, 1, …, -1 for the others."""
    index = np.full(count, -1)
    index[subset] = np.arange(len(subset))
    return index
