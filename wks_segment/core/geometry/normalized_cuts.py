"""Parts of one pose as a person would cut them: normalized cuts along creases and where the thickness changes.

Golovinskiy and Funkhouser, "Randomized cuts for 3D mesh analysis" (2008), section 4.2, after Shi and Malik (2000):
patches grow together as long as that lowers the sum over all parts of border length by area. Near to people, but not
the same in every pose; learning takes them for a measure of which segments people would see.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components, dijkstra

from ..mesh.adjacency import FaceAdjacency
from ..mesh.surface import Surface
from ..mesh.triangle_mesh import BoolArray, FloatArray, IntArray
from .creases import MOST_CONCAVE

PATCHES = 250
"""Patches that a surface is cut into at first."""
PATCH_CREASE = 0.3
"""How much longer a way across a crease is, in units of its curvature: patches end there."""
GAINS = (7.0, 10.0, 14.0)
"""Parts grow together while that lowers the sum of border by area by this, for a surface of area 1. People cut coarser
or finer than each of these by itself."""


def parts(surface: Surface, adjacency: FaceAdjacency, borders: FloatArray, curvature: FloatArray) -> IntArray:
    """Cut a surface into parts.

    Parameters
    ----------
    surface : Surface
        With m original faces.
    adjacency : FaceAdjacency
        Of these.
    borders : (p,) array
        Weighted length of the border between neighbors, for a surface of area 1.
    curvature : (p,) array
        Across it, negative in a crease.

    Returns
    -------
    (len(GAINS), m) int array: part of each face, coarse to fine.
    """
    areas = surface.original.face_areas / surface.original.area
    patch = _patches(surface, adjacency, curvature)
    return np.stack([normalized_cut(patch, areas, adjacency.pairs, borders, gain) for gain in GAINS])


def normalized_cut(patch: IntArray, areas: FloatArray, pairs: IntArray, borders: FloatArray, gain: float) -> IntArray:
    """Let patches grow together, best pair first, while that lowers the sum of border by area by `gain`.

    Parameters
    ----------
    patch : (m,) int array
        Numbered 0, 1, …, r − 1.
    areas : (m,) array
        Of the faces; they sum to 1.
    pairs : (p, 2) int array
        Neighboring faces.
    borders : (p,) array
        Weighted length of the border between them.
    gain : float

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
    # What does not hang together never grows together: a thousand loose parts are a thousand small tables.
    together = connected_components(touch, directed=False)[1]
    order = np.argsort(together, kind="stable")
    for some in np.split(order, np.flatnonzero(np.diff(together[order])) + 1):
        if len(some) > 1:
            block = np.ix_(some, some)
            border, beside = cut[block].toarray(), touch[block].toarray() > 0
            owner[some] = some[_grown_together(border + border.T, beside | beside.T, area[some], gain)]
    return np.asarray(np.unique(owner, return_inverse=True)[1][patch])


def _grown_together(cut: FloatArray, touch: BoolArray, area: FloatArray, gain: float) -> IntArray:
    """(r,) the patch that each of r patches belongs to in the end, given weighted borders, neighbors and areas."""
    count = len(area)
    area, border = area.copy(), cut.sum(axis=1)
    gained = np.where(touch, gains_of_joining(cut, border, area), -np.inf)
    owner = np.arange(count)
    for _ in range(count - 1):
        i, j = divmod(int(gained.argmax()), count)
        if gained[i, j] < gain:
            break
        owner[owner == i] = j
        area[j] += area[i]
        cut[j] += cut[i]
        touch[j] |= touch[i]
        cut[i], touch[i] = 0, False
        cut[:, j], touch[:, j] = cut[j], touch[j]
        cut[:, i], touch[:, i] = 0, False
        cut[j, j], touch[j, j] = 0, False
        border[j], border[i] = cut[j].sum(), 0
        gained[i] = gained[:, i] = -np.inf
        gained[j] = np.where(touch[j], gains_of_joining(cut, border, area, np.array([j]))[0], -np.inf)
        gained[:, j] = gained[j]
    return owner


def gains_of_joining(cut: FloatArray, border: FloatArray, area: FloatArray, rows: IntArray | None = None) -> FloatArray:
    """(len(rows), r) by how much the sum of border by area falls if each of some parts (None: all) is joined with each.

    `cut` holds the (r, r) weighted borders between parts, `border` the (r,) whole border of each.
    """
    some = slice(None) if rows is None else rows
    alone = (border / area)[some, None] + border / area
    joined = (border[some, None] + border - 2 * cut[some]) / (area[some, None] + area)
    return np.asarray(alone - joined)


def _patches(surface: Surface, adjacency: FaceAdjacency, curvature: FloatArray) -> IntArray:
    """(m,) patch of each face: that of the seed which is nearest, ways across creases being longer."""
    original = surface.original
    m = original.n_faces
    centers = original.vertices[original.faces].mean(axis=1)
    a, b = adjacency.pairs.T
    steps = np.linalg.norm(centers[a] - centers[b], axis=1) / np.sqrt(original.area)
    ways = steps * (1 + PATCH_CREASE * np.clip(-curvature, 0, MOST_CONCAVE)) + 1e-9
    graph = coo_matrix((np.append(ways, ways), (np.append(a, b), np.append(b, a))), shape=(m, m)).tocsr()
    # Seeds as far from each other as can be, and one in each loose part.
    seeds = [int(original.face_areas.argmax())]
    distance = np.full(m, np.inf)
    for _ in range(min(PATCHES, m) - 1):
        offset = centers - centers[seeds[-1]]
        np.minimum(distance, np.einsum("ij,ij->i", offset, offset), out=distance)
        seeds.append(int(distance.argmax()))
    of_parts = np.unique(connected_components(graph, directed=False)[1], return_index=True)[1]
    nearest = dijkstra(graph, indices=np.unique(np.append(seeds, of_parts)), min_only=True, return_predecessors=True)[2]
    return np.asarray(np.unique(nearest, return_inverse=True)[1])
