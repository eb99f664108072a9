"""Parts of one pose as a person would cut them: normalized cuts along creases and where the thickness changes.

Golovinskiy and Funkhouser, "Randomized cuts for 3D mesh analysis" (2008), section 4.2, after Shi and Malik (2000):
patches are joined as long as that lowers the sum over all parts of border length by area. The result is close to
people's cuts, but differs from pose to pose; learning uses it to measure which segments people would see.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra

from ..mesh.adjacency import FaceAdjacency
from ..mesh.surface import Surface
from ..mesh.triangle_mesh import BoolArray, FloatArray, IntArray, connected_groups
from .agglomeration import gains_of_merging, merge_in_table
from .creases import MOST_CONCAVE

PATCHES = 250
"""Number of patches that a surface is divided into first; tables of pairs of patches grow with its square."""
PATCH_CREASE = 0.3
"""Extra length of a path across a crease, in units of its curvature, so that patches end at creases."""
LEAST_GAINS = (7.0, 10.0, 14.0)
"""Least decrease of the sum of border length by area for which two parts are joined, on a surface of area 1: one cut
for each value. Choosing mixtures by three cuts instead of one at 10 lowers their Rand-index error from 0.154 to 0.148
("Which mixture?" in docs/dev/experiments.md)."""


def human_like_parts(
    surface: Surface, adjacency: FaceAdjacency, borders: FloatArray, curvature: FloatArray
) -> IntArray:
    """Cut a surface into parts as a person would, once for each value of `LEAST_GAINS`.

    Parameters
    ----------
    surface : Surface
        With m original faces.
    adjacency : FaceAdjacency
        Of the original faces.
    borders : (p,) array
        Weighted length of the border between neighbors, for a surface of area 1.
    curvature : (p,) array
        Curvature across that border, negative in a crease.

    Returns
    -------
    (len(LEAST_GAINS), m) int array: part of each face, coarse to fine.
    """
    areas = surface.original.face_areas / surface.original.area
    patch = _patches(surface, adjacency, curvature)
    return np.stack([normalized_cut(patch, areas, adjacency.pairs, borders, gain) for gain in LEAST_GAINS])


def normalized_cut(
    patch: IntArray, areas: FloatArray, pairs: IntArray, borders: FloatArray, least_gain: float
) -> IntArray:
    """Join patches, best pair first, as long as that lowers the sum of border length by area by `least_gain`.

    Parameters
    ----------
    patch : (m,) int array
        Patch of each face, numbered 0, 1, …, r − 1.
    areas : (m,) array
        Areas of the faces; they sum to 1.
    pairs : (p, 2) int array
        Neighboring faces.
    borders : (p,) array
        Weighted length of the border between them.
    least_gain : float

    Returns
    -------
    (m,) int array: part of each face.
    """
    count = int(patch.max()) + 1
    a, b = patch[pairs].T
    across = a != b
    a, b, shape = a[across], b[across], (count, count)
    cut = coo_matrix((borders[across], (a, b)), shape=shape).tocsr()
    touch = coo_matrix((np.ones(len(a)), (a, b)), shape=shape).tocsr()
    area = np.maximum(np.bincount(patch, weights=areas, minlength=count), 1e-12)
    owner = np.arange(count)
    # Patches that are not connected are never joined: a thousand islands need a thousand small tables, not a large one.
    connected = connected_groups(np.stack([a, b], axis=1), count)
    order = np.argsort(connected, kind="stable")
    for patches in np.split(order, np.flatnonzero(np.diff(connected[order])) + 1):
        if len(patches) > 1:
            block = np.ix_(patches, patches)
            border, beside = cut[block].toarray(), touch[block].toarray() > 0
            owner[patches] = patches[_greedily_joined(border + border.T, beside | beside.T, area[patches], least_gain)]
    return np.asarray(np.unique(owner, return_inverse=True)[1][patch])


def _greedily_joined(cut: FloatArray, touch: BoolArray, area: FloatArray, least_gain: float) -> IntArray:
    """(r,) patch whose part each of r patches ends up in, given weighted borders, neighbors and areas."""
    count = len(area)
    area, border = area.copy(), cut.sum(axis=1)
    gains = np.where(touch, gains_of_merging(cut, border, area), -np.inf)
    owner = np.arange(count)
    for _ in range(count - 1):
        i, j = divmod(int(gains.argmax()), count)
        if gains[i, j] < least_gain:
            break
        owner[owner == i] = j
        area[j] += area[i]
        for table in (cut, touch):
            merge_in_table(table, j, i)
            table[j, j] = 0
        border[j], border[i] = cut[j].sum(), 0
        gains[i] = gains[:, i] = -np.inf
        gains[j] = np.where(touch[j], gains_of_merging(cut, border, area, np.array([j]))[0], -np.inf)
        gains[:, j] = gains[j]
    return owner


def _patches(surface: Surface, adjacency: FaceAdjacency, curvature: FloatArray) -> IntArray:
    """(m,) patch of each face: the nearest seed, by paths over the surface that are longer across creases."""
    original = surface.original
    m = original.n_faces
    centers = original.face_centers
    a, b = adjacency.pairs.T
    steps = np.linalg.norm(centers[a] - centers[b], axis=1) / np.sqrt(original.area)
    lengths = steps * (1 + PATCH_CREASE * np.clip(-curvature, 0, MOST_CONCAVE)) + 1e-9
    graph = coo_matrix((np.append(lengths, lengths), (np.append(a, b), np.append(b, a))), shape=(m, m)).tocsr()
    # Seeds are as far from each other as possible, and each island has one.
    seeds = [int(original.face_areas.argmax())]
    distance = np.full(m, np.inf)
    for _ in range(min(PATCHES, m) - 1):
        offset = centers - centers[seeds[-1]]
        np.minimum(distance, np.einsum("ij,ij->i", offset, offset), out=distance)
        seeds.append(int(distance.argmax()))
    first_faces = np.unique(connected_groups(adjacency.pairs, m), return_index=True)[1]
    sources = np.unique(np.append(seeds, first_faces))
    nearest = dijkstra(graph, indices=sources, min_only=True, return_predecessors=True)[2]
    return np.asarray(np.unique(nearest, return_inverse=True)[1])
