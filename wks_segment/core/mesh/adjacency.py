"""Neighbors among faces, the connected regions of a labeling, and the removal of regions that are too small."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix
from scipy.spatial import cKDTree

from .triangle_mesh import BoolArray, FloatArray, IntArray, connected_groups, edges_of


@dataclass(frozen=True)
class FaceAdjacency:
    """Pairs of faces that share an edge.

    Attributes
    ----------
    pairs : (p, 2) int array
        The faces on the two sides of an edge. Three or more faces at one edge form a chain of pairs.
    lengths : (p,) array
        Length of that edge.
    """

    pairs: IntArray
    lengths: FloatArray

    @classmethod
    def of(cls, faces: IntArray, vertices: FloatArray) -> FaceAdjacency:
        """Neighbors among (m, 3) faces with corners in (n, 3) vertices."""
        edges = edges_of(faces)
        order = np.lexsort((edges[:, 1], edges[:, 0]))
        edges, face = edges[order], order // 3
        same = np.flatnonzero((edges[1:] == edges[:-1]).all(axis=1))
        lengths = np.linalg.norm(vertices[edges[same, 0]] - vertices[edges[same, 1]], axis=1)
        return cls(np.stack([face[same], face[same + 1]], axis=1), lengths)

    def across(self, polygon_of: IntArray) -> BoolArray:
        """(p,) whether the two faces belong to different polygons, given the polygon of each face (-1: none)."""
        pairs = polygon_of[self.pairs]
        return np.asarray((pairs[:, 0] != pairs[:, 1]) & (pairs >= 0).all(axis=1))

    def between_polygons(self, polygon_of: IntArray) -> FaceAdjacency:
        """Neighbors among polygons, given the polygon of each face (-1: none); edges inside a polygon drop out."""
        across = self.across(polygon_of)
        return FaceAdjacency(polygon_of[self.pairs[across]], self.lengths[across])

    def among(self, pairs: IntArray) -> BoolArray:
        """(p,) whether each pair is one of (q, 2) given pairs, in either order."""
        base = 1 + max(int(self.pairs.max(initial=0)), int(np.max(pairs, initial=0)))
        own_keys, given_keys = (np.sort(array, axis=1) @ np.array([base, 1]) for array in (self.pairs, pairs))
        return np.isin(own_keys, given_keys)


@dataclass(frozen=True)
class FaceGraph:
    """Faces or polygons as the nodes of a graph.

    Attributes
    ----------
    areas : (m,) array
    centers : (m, 3) array
        In the unit whose square is that of the areas.
    adjacency : FaceAdjacency
        Its lengths in the same unit. A pair may occur several times, as for polygons that share several edges.
    """

    areas: FloatArray
    centers: FloatArray
    adjacency: FaceAdjacency


def connected_regions(labels: IntArray, adjacency: FaceAdjacency) -> IntArray:
    """(m,) connected region of each face: faces with one label that are connected across edges.

    Regions are numbered 0, 1, … by label, and those of one label by their lowest face.
    """
    pairs = adjacency.pairs
    region = connected_groups(pairs[labels[pairs[:, 0]] == labels[pairs[:, 1]]], len(labels))
    first_face = np.unique(region, return_index=True)[1]
    number = np.empty(len(first_face), dtype=np.int64)
    number[np.lexsort((first_face, labels[first_face]))] = np.arange(len(first_face))
    return number[region]


def merge_small_regions(
    labels: IntArray, graph: FaceGraph, min_share: float, min_share_of_largest: float = 0.0
) -> tuple[IntArray, FaceAdjacency]:
    """Give every connected region below a share of the area the label of a neighbor.

    The smallest region goes first, to the neighbor with which it shares the longest border. An island that is too small
    as a whole takes the label of the nearest face of a region that is large enough, as an eye takes that of its head,
    and counts as adjacent to that face afterward.

    Parameters
    ----------
    labels : (m,) int array
        -1: a face without a label, which keeps none.
    graph : FaceGraph
    min_share : float
        Between 0 and 1.
    min_share_of_largest : float
        A region below this share of the largest region with its label is merged as well: for example the narrow band
        of a third label where one label passes into another.

    Returns
    -------
    (m,) int array of labels, and the adjacency with the merged islands tied to their nearest faces.
    """
    adjacency = graph.adjacency
    region = connected_regions(labels, adjacency)
    count = region.max() + 1
    size: FloatArray = np.bincount(region, weights=graph.areas, minlength=count).astype(np.float64)
    label_of = np.zeros(count, dtype=np.int64)
    label_of[region] = labels
    least = min_share * graph.areas.sum()
    largest = np.zeros(int(labels.max()) + 2)
    np.maximum.at(largest, label_of + 1, size)
    minor = size < min_share_of_largest * largest[label_of + 1]

    target = _merge_targets(size, minor, least, _border_lengths(region, adjacency))
    merged = label_of[target][region]
    islands = (size[target][region] < least) & (merged >= 0)
    large = ~islands & (merged >= 0)
    if not (islands.any() and large.any()):
        return merged, adjacency
    small_faces, large_faces = np.flatnonzero(islands), np.flatnonzero(large)
    nearest = large_faces[cKDTree(graph.centers[large_faces]).query(graph.centers[small_faces])[1]]
    merged[small_faces] = merged[nearest]
    ties = np.stack([small_faces, nearest], axis=1)
    return merged, FaceAdjacency(
        np.concatenate([adjacency.pairs, ties]), np.concatenate([adjacency.lengths, np.zeros(len(ties))])
    )


def _merge_targets(size: FloatArray, minor: BoolArray, least: float, borders: dict[int, dict[int, float]]) -> IntArray:
    """(r,) region that each of r regions ends up in, merging small ones in order of size; updates `size` in place.

    `minor` regions are merged whatever their size is, others below `least`.
    """
    owner = np.arange(len(size))
    for region in np.argsort(size, kind="stable").tolist():
        # Its size may have grown by smaller regions before its turn.
        if size[region] >= least and not minor[region]:
            continue
        shared: dict[int, float] = defaultdict(float)
        for neighbor, length in borders[region].items():
            shared[_root(owner, neighbor)] += length
        shared.pop(region, None)
        if not shared:
            continue
        target = max(shared, key=lambda i: (shared[i], -i))
        # Neighbors with the target's label become one region with it only now, and keep their own borders.
        owner[region] = target
        size[target] += size[region]
        for neighbor, length in borders.pop(region).items():
            borders[target][neighbor] = borders[target].get(neighbor, 0.0) + length
    return np.array([_root(owner, i) for i in range(len(size))])


def _root(owner: IntArray, i: int) -> int:
    """Region that region i was merged into in the end; shortens the way there for the next call."""
    while owner[i] != i:
        owner[i] = owner[owner[i]]
        i = int(owner[i])
    return i


def _border_lengths(region: IntArray, adjacency: FaceAdjacency) -> dict[int, dict[int, float]]:
    """Length of the border that each region shares with each of its neighbors."""
    a, b = region[adjacency.pairs].T
    across = a != b
    shape = (int(region.max()) + 1,) * 2
    half = coo_matrix((adjacency.lengths[across], (a[across], b[across])), shape=shape).tocsr()
    full = (half + half.T).tocoo()
    borders: dict[int, dict[int, float]] = {i: {} for i in range(shape[0])}
    for i, j, length in zip(full.row.tolist(), full.col.tolist(), full.data.tolist(), strict=True):
        borders[i][j] = length
    return borders
