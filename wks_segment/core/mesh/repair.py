"""Damage that scans and imports come with, undone on the copy that the operator lives on: spikes and small holes.

Neither moves a vertex of the artist's mesh. Both look at proportions only, so that the same happens in every pose.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix, diags
from scipy.sparse.csgraph import connected_components

from .triangle_mesh import FloatArray, IntArray, TriangleMesh, edge_lengths, edges_of, unique_edges

SPIKE_HEIGHT = 3.0
"""Distance of a spike from the middle of its neighbors, at least, in units of the mesh's median edge …"""
SPIKE_SLENDERNESS = 2.0
"""… and in units of the mean edge between its neighbors."""
SPIKE_ROUNDS = 3
"""Neighboring spikes hide each other, so that all come to light only one after another."""
HOLE_PERIMETER = 0.5
"""Largest perimeter of a hole that is closed, as a fraction of the square root of the area of its loose part."""


def without_spikes(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """(n, 3) positions in which each vertex that sticks out of its surroundings is in the middle of its neighbors.

    Shot noise: a single vertex thrown far off makes long slivers, which add area and pin the eigenfunctions. The tip of
    a horn or a finger is not meant: it stands on edges as long as itself, or is no longer than the other edges.
    """
    n = len(vertices)
    lengths = edge_lengths(vertices, faces)
    typical = np.median(lengths)
    # No vertex is further from the middle of its neighbors than from the furthest of them: most need no second look.
    long = lengths > SPIKE_HEIGHT * typical
    suspect = np.zeros(n, dtype=bool)
    for i in range(3):
        suspect[faces[long[:, i]][:, [i, (i + 1) % 3]]] = True
    faces = faces[suspect[faces].any(axis=1)]
    if not len(faces):
        return vertices
    a, b = edges_of(faces).T
    adjacency = csr_matrix((np.ones(2 * len(a)), (np.append(a, b), np.append(b, a))), shape=(n, n))
    around = np.bincount(faces.ravel(), minlength=n)
    spiky = np.zeros(n, dtype=bool)

    def middles() -> FloatArray:
        """Of the sound neighbors of each vertex; its own place if there are none."""
        sound = adjacency @ diags((~spiky).astype(np.float64))
        total = np.asarray(sound.sum(axis=1)).reshape(-1, 1)
        return np.where(total > 0, (sound @ vertices) / np.maximum(total, 1), vertices)

    for _ in range(SPIKE_ROUNDS):
        height = np.linalg.norm(vertices - middles(), axis=1)
        opposite = np.roll(faces, -1, axis=1), np.roll(faces, -2, axis=1)
        across = np.linalg.norm(vertices[opposite[0]] - vertices[opposite[1]], axis=2)
        base = np.bincount(faces.ravel(), weights=across.ravel(), minlength=n) / np.maximum(around, 1)
        new = (height > SPIKE_HEIGHT * typical) & (height > SPIKE_SLENDERNESS * base) & (around > 2) & suspect & ~spiky
        if not new.any():
            break
        spiky |= new
        vertices = np.where(spiky[:, None], middles(), vertices)
    return vertices


def small_holes(mesh: TriangleMesh) -> tuple[FloatArray, IntArray]:
    """Vertices and faces that close a mesh's small holes, each a flat cap of two rings around its middle.

    Returns
    -------
    (k, 3) array of vertices to add behind those of the mesh, and (l, 3) int array of faces to add.
    """
    edges, _, count = unique_edges(mesh.faces)
    border = edges[count == 1]
    if not len(border):
        return np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64)
    graph = coo_matrix((np.ones(len(border), dtype=np.int8), tuple(border.T)), shape=(mesh.n_vertices,) * 2)
    loop = connected_components(graph, directed=False)[1]
    # A loop of two border edges at every vertex is a simple one; others branch, and what is a hole there is unclear.
    at_vertex = np.bincount(border.ravel(), minlength=mesh.n_vertices)
    simple = np.ones(loop.max() + 1, dtype=bool)
    simple[loop[(at_vertex > 0) & (at_vertex != 2)]] = False
    lengths = np.linalg.norm(mesh.vertices[border[:, 0]] - mesh.vertices[border[:, 1]], axis=1)
    perimeter = np.bincount(loop[border[:, 0]], weights=lengths, minlength=len(simple))
    part_area = np.bincount(mesh.components, weights=mesh.vertex_areas)
    of_loop = np.zeros(len(simple), dtype=np.int64)
    of_loop[loop] = mesh.components
    closed = simple & (perimeter <= HOLE_PERIMETER * np.sqrt(part_area[of_loop])) & (perimeter > 0)
    border = border[closed[loop[border[:, 0]]]]
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
