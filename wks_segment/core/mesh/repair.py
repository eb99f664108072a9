"""Repair of spikes and small holes, as scans and imported files have them, on the copy that eigenpairs are computed on.

The user's own mesh does not change. Both repairs depend on proportions only, so that every pose is repaired alike.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_matrix, diags

from .triangle_mesh import (
    BoolArray,
    FloatArray,
    IntArray,
    TriangleMesh,
    connected_groups,
    edge_lengths,
    edges_of,
    unique_edges,
)

SPIKE_HEIGHT = 3.0
"""Least distance of a spike from the middle of its neighbors, in units of the median edge of the mesh."""
SPIKE_SLENDERNESS = 2.0
"""Least distance of a spike from the middle of its neighbors, in units of the mean edge between these."""
SPIKE_ROUNDS = 3
"""Rounds of looking for spikes: of neighboring spikes, some show only when others are gone."""
HOLE_PERIMETER = 0.5
"""Largest perimeter of a hole that is closed, in units of the square root of the area of its island."""


def without_spikes(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """(n, 3) positions with each spike moved to the middle of its neighbors.

    A spike is a single vertex far away from its neighbors, as noise of a scan leaves it: its long slivers add area and
    disturb the eigenfunctions. The tip of a horn or a finger is no spike: its height is at most twice the
    edges around its base, or three times the typical edge.
    """
    n = len(vertices)
    lengths = edge_lengths(vertices, faces)
    typical = np.median(lengths)
    # A vertex is no further from the middle of its neighbors than from the furthest one: most vertices drop out here.
    long = lengths > SPIKE_HEIGHT * typical
    suspect = np.zeros(n, dtype=bool)
    for i in range(3):
        suspect[faces[long[:, i]][:, [i, (i + 1) % 3]]] = True
    faces = faces[suspect[faces].any(axis=1)]
    if not len(faces):
        return vertices
    a, b = edges_of(faces).T
    adjacency = csr_matrix((np.ones(2 * len(a)), (np.append(a, b), np.append(b, a))), shape=(n, n))
    n_faces_at = np.bincount(faces.ravel(), minlength=n)
    spiky = np.zeros(n, dtype=bool)
    for _ in range(SPIKE_ROUNDS):
        height = np.linalg.norm(vertices - _neighbor_means(vertices, adjacency, spiky), axis=1)
        opposite = np.roll(faces, -1, axis=1), np.roll(faces, -2, axis=1)
        across = np.linalg.norm(vertices[opposite[0]] - vertices[opposite[1]], axis=2)
        base = np.bincount(faces.ravel(), weights=across.ravel(), minlength=n) / np.maximum(n_faces_at, 1)
        high = (height > SPIKE_HEIGHT * typical) & (height > SPIKE_SLENDERNESS * base)
        new = high & (n_faces_at > 2) & suspect & ~spiky
        if not new.any():
            break
        spiky |= new
        vertices = np.where(spiky[:, None], _neighbor_means(vertices, adjacency, spiky), vertices)
    return vertices


def _neighbor_means(vertices: FloatArray, adjacency: csr_matrix, spiky: BoolArray) -> FloatArray:
    """(n, 3) mean of the neighbors of each vertex that are no spikes; its own position if there are none."""
    weights = adjacency @ diags((~spiky).astype(np.float64))
    total = np.asarray(weights.sum(axis=1)).reshape(-1, 1)
    return np.where(total > 0, (weights @ vertices) / np.maximum(total, 1), vertices)


def caps_of_small_holes(mesh: TriangleMesh) -> tuple[FloatArray, IntArray]:
    """Caps that close the small holes of a mesh, each of two rings of faces around the middle of the hole.

    Returns
    -------
    (k, 3) array of vertices to append to those of the mesh, and (l, 3) int array of faces to append.
    """
    edges, _, count = unique_edges(mesh.faces)
    border = edges[count == 1]
    if not len(border):
        return np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64)
    loop = connected_groups(border, mesh.n_vertices)
    # A loop is simple if each vertex has two border edges. Others branch, and it is not clear what the hole is there.
    n_border_edges = np.bincount(border.ravel(), minlength=mesh.n_vertices)
    simple = np.ones(loop.max() + 1, dtype=bool)
    simple[loop[(n_border_edges > 0) & (n_border_edges != 2)]] = False
    lengths = np.linalg.norm(mesh.vertices[border[:, 0]] - mesh.vertices[border[:, 1]], axis=1)
    perimeter = np.bincount(loop[border[:, 0]], weights=lengths, minlength=len(simple))
    island_area = np.bincount(mesh.islands, weights=mesh.vertex_areas)
    island_of_loop = np.zeros(len(simple), dtype=np.int64)
    island_of_loop[loop] = mesh.islands
    small = simple & (perimeter <= HOLE_PERIMETER * np.sqrt(island_area[island_of_loop])) & (perimeter > 0)
    border = border[small[loop[border[:, 0]]]]
    if not len(border):
        return np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64)
    rim = np.unique(border)
    holes, hole = np.unique(loop[rim], return_inverse=True)
    sums = csr_matrix((np.ones(len(rim)), (hole, np.arange(len(rim)))), shape=(len(holes), len(rim)))
    middle = diags(1 / np.asarray(sums.sum(axis=1)).ravel()) @ sums @ mesh.vertices[rim]
    halfway = (mesh.vertices[rim] + middle[hole]) / 2
    inner = np.zeros(mesh.n_vertices, dtype=np.int64)
    inner[rim] = mesh.n_vertices + np.arange(len(rim))
    center = np.zeros(mesh.n_vertices, dtype=np.int64)
    center[rim] = mesh.n_vertices + len(rim) + hole
    a, b = border.T
    caps = [(a, b, inner[b]), (a, inner[b], inner[a]), (inner[a], inner[b], center[a])]
    return np.concatenate([halfway, middle]), np.concatenate([np.stack(cap, axis=1) for cap in caps])
