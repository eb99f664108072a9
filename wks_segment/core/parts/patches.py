"""Patches: a few hundred small regions that end at creases, from which parts are put together."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra

from ..mesh.adjacency import FaceAdjacency
from ..mesh.canonical import STEP, in_steps
from ..mesh.triangle_mesh import FloatArray, IntArray, connected_groups

N_PATCHES = 300
"""Number of patches that a surface is divided into; tables of pairs of patches grow with its square."""
SINGLE_FACES = 600
"""Largest number of faces for which each face is a patch of its own."""
CREASE, STEEPEST = 0.3, 15.0
"""Extra length of a path across a crease, in units of its curvature up to a limit, so that patches end at creases."""


def patches_of(
    centers: FloatArray, areas: FloatArray, adjacency: FaceAdjacency, curvature: FloatArray, image: IntArray | None
) -> IntArray:
    """(m,) patch of each face: the nearest seed, by paths over the surface that are longer across creases.

    Parameters
    ----------
    centers : (m, 3) array
        Of the faces, of a surface of area 1.
    areas : (m,) array
    adjacency : FaceAdjacency
        Of the faces, ties between islands included.
    curvature : (p,) array
        Across each border, negative in a crease.
    image : (m,) int array, optional
        Mirror image of each face, −1 for none; given, patches are mirror images of each other too.
    """
    m = len(centers)
    if m <= SINGLE_FACES:
        return np.arange(m)
    a, b = adjacency.pairs.T
    steps = np.linalg.norm(centers[a] - centers[b], axis=1)
    lengths = in_steps(steps * (1 + CREASE * np.clip(-curvature, 0, STEEPEST))) + STEP
    graph = coo_matrix((np.append(lengths, lengths), (np.append(a, b), np.append(b, a))), shape=(m, m)).tocsr()
    sources = _seeds(centers, areas, adjacency, image)
    nearest = dijkstra(graph, indices=sources, min_only=True, return_predecessors=True)[2]
    if image is not None:
        nearest = _mirrored(nearest, image)
    return np.asarray(np.unique(nearest, return_inverse=True)[1])


def _seeds(centers: FloatArray, areas: FloatArray, adjacency: FaceAdjacency, image: IntArray | None) -> IntArray:
    """Faces as far from each other as possible, with their mirror images; each connected group of faces has one."""
    # The face farthest from the middle comes first, wherever it is in the file.
    offset = centers - np.average(centers, axis=0, weights=areas)
    seeds = [int(in_steps(np.einsum("ij,ij->i", offset, offset)).argmax())]
    distance = np.full(len(centers), np.inf)
    measured = 0
    while True:
        if image is not None and image[seeds[-1]] >= 0 and image[seeds[-1]] not in seeds:
            seeds.append(int(image[seeds[-1]]))
        for seed in seeds[measured:]:
            offset = centers - centers[seed]
            np.minimum(distance, in_steps(np.einsum("ij,ij->i", offset, offset)), out=distance)
        measured = len(seeds)
        if len(seeds) >= min(N_PATCHES, len(centers)):
            break
        seeds.append(int(distance.argmax()))
    group = connected_groups(adjacency.pairs, len(centers))
    first_faces = np.unique(group, return_index=True)[1]
    return np.unique(np.append(seeds, first_faces[~np.isin(group[first_faces], group[seeds])]))


def _mirrored(nearest: IntArray, image: IntArray) -> IntArray:
    """(m,) seed of each face, where mirrored faces have mirrored seeds: those of the first face of each pair."""
    result = nearest.copy()
    second = np.flatnonzero((image >= 0) & (image < np.arange(len(image))))
    seeds = image[nearest[image[second]]]
    result[second] = np.where(seeds >= 0, seeds, nearest[second])
    return result
