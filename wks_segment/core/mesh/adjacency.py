"""Which faces hang together: neighbors, connected regions, crumbs."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from .triangle_mesh import BoolArray, FloatArray, IntArray, edges_of


@dataclass(frozen=True)
class FaceAdjacency:
    """Which faces share an edge.

    Attributes
    ----------
    pairs : (p, 2) int array
        Faces on the two sides of an edge. Where more than two faces meet, they form a chain.
    lengths : (p,) array
        Length of that edge.
    """

    pairs: IntArray
    lengths: FloatArray

    @classmethod
    def of(cls, faces: IntArray, vertices: FloatArray) -> FaceAdjacency:
        """Find the neighbors of (m, 3) faces with corners in (n, 3) vertices."""
        edges = edges_of(faces)
        order = np.lexsort((edges[:, 1], edges[:, 0]))
        edges, owner = edges[order], order // 3
        same = np.flatnonzero((edges[1:] == edges[:-1]).all(axis=1))
        lengths = np.linalg.norm(vertices[edges[same, 0]] - vertices[edges[same, 1]], axis=1)
        return cls(np.stack([owner[same], owner[same + 1]], axis=1), lengths)

    def across(self, polygon_of: IntArray) -> BoolArray:
        """(p,) whether the two sides are of different polygons, given the polygon of each face (-1: none)."""
        pairs = polygon_of[self.pairs]
        return np.asarray((pairs[:, 0] != pairs[:, 1]) & (pairs >= 0).all(axis=1))

    def between_polygons(self, polygon_of: IntArray) -> FaceAdjacency:
        """The same borders between polygons, given the polygon of each face (-1: none); those inside one drop out."""
        across = self.across(polygon_of)
        return FaceAdjacency(polygon_of[self.pairs[across]], self.lengths[across])

    def among(self, pairs: IntArray) -> BoolArray:
        """(p,) whether the border is one of (q, 2) others, whichever face comes first."""
        most = 1 + max(int(self.pairs.max(initial=0)), int(np.max(pairs, initial=0)))
        here, there = (np.sort(each, axis=1) @ np.array([most, 1]) for each in (self.pairs, pairs))
        return np.isin(here, there)


def connected_regions(labels: IntArray, adjacency: FaceAdjacency) -> IntArray:
    """(m,) connected part of each face: faces of one label that hang together by edges, numbered 0, 1, …

    Numbered by label first, within a label by the lowest face.
    """
    inside = adjacency.pairs[labels[adjacency.pairs[:, 0]] == labels[adjacency.pairs[:, 1]]]
    graph = coo_matrix((np.ones(len(inside)), (inside[:, 0], inside[:, 1])), shape=(len(labels),) * 2)
    part = connected_components(graph, directed=False)[1]
    first = np.unique(part, return_index=True)[1]
    rank = np.empty(len(first), dtype=np.int64)
    rank[np.lexsort((first, labels[first]))] = np.arange(len(first))
    return rank[part]


def merge_crumbs(
    labels: IntArray,
    areas: FloatArray,
    centers: FloatArray,
    adjacency: FaceAdjacency,
    min_share: float,
    least_of_largest: float = 0.0,
) -> tuple[IntArray, FaceAdjacency]:
    """Give every connected region under a share of the area the label of a neighbor.

    The smallest goes first, to the neighbor with which it shares most border. A loose piece that is too small as a
    whole takes the label of the face nearest to it that belongs to a large enough region, as an eye does that of its
    head, and counts as adjacent to it from then on.

    Parameters
    ----------
    labels : (m,) int array
        -1: a face that takes no part.
    areas : (m,) array
    centers : (m, 3) array
    adjacency : FaceAdjacency
    min_share : float
        Between 0 and 1.
    least_of_largest : float
        A region is a crumb as well under this share of the largest one with its label, as the narrow band between two
        others where the labels pass through a third.

    Returns
    -------
    (m,) int array of labels, and the adjacency with the loose pieces tied to what adopted them.
    """
    region = connected_regions(labels, adjacency)
    count = region.max() + 1
    size = np.bincount(region, weights=areas, minlength=count)
    label_of = np.zeros(count, dtype=np.int64)
    label_of[region] = labels
    least = min_share * areas.sum()
    largest = np.zeros(int(labels.max()) + 2)
    np.maximum.at(largest, label_of + 1, size)
    stray = size < least_of_largest * largest[label_of + 1]

    borders = _border_lengths(region, adjacency)
    owner = np.arange(count)

    def root(i: int) -> int:
        while owner[i] != i:
            owner[i] = owner[owner[i]]
            i = int(owner[i])
        return i

    for crumb in np.argsort(size, kind="stable"):
        # A crumb may have grown by smaller ones before its turn; what is stray remains so.
        if owner[crumb] != crumb or (size[crumb] >= least and not stray[crumb]):
            continue
        shared: dict[int, float] = defaultdict(float)
        for neighbor, length in borders[crumb].items():
            shared[root(neighbor)] += length
        shared.pop(int(crumb), None)
        if not shared:
            continue
        target = max(shared, key=lambda i: (shared[i], -i))
        # Neighbors of the crumb's label are one region with it only from now on, and keep their own borders.
        owner[crumb] = target
        size[target] += size[crumb]
        for neighbor, length in borders.pop(int(crumb)).items():
            borders[target][neighbor] = borders[target].get(neighbor, 0.0) + length
    owner = np.array([root(i) for i in range(count)])
    merged = label_of[owner][region]
    loose = (size[owner][region] < least) & (merged >= 0)
    large = ~loose & (merged >= 0)
    if not (loose.any() and large.any()):
        return merged, adjacency
    loose, large = np.flatnonzero(loose), np.flatnonzero(large)
    adopting = large[cKDTree(centers[large]).query(centers[loose])[1]]
    merged[loose] = merged[adopting]
    ties = np.stack([loose, adopting], axis=1)
    return merged, FaceAdjacency(
        np.concatenate([adjacency.pairs, ties]), np.concatenate([adjacency.lengths, np.zeros(len(ties))])
    )


def _border_lengths(region: IntArray, adjacency: FaceAdjacency) -> dict[int, dict[int, float]]:
    """For each region the length of border that it shares with each neighbor."""
    a, b = region[adjacency.pairs].T
    across = a != b
    shape = (int(region.max()) + 1,) * 2
    half = coo_matrix((adjacency.lengths[across], (a[across], b[across])), shape=shape).tocsr()
    full = (half + half.T).tocoo()
    borders: dict[int, dict[int, float]] = {i: {} for i in range(shape[0])}
    for i, j, length in zip(full.row.tolist(), full.col.tolist(), full.data.tolist(), strict=True):
        borders[i][j] = length
    return borders
