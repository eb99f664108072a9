"""Subdivision of long edges, so that every triangle is small enough for the eigenfunctions.

The shape of the surface does not change: new vertices lie on its edges. On coarse triangles an eigenfunction depends on
how coarse they are; if all triangles are small enough, it depends on the shape alone and not on the meshing.
"""

from __future__ import annotations

import numpy as np

from .triangle_mesh import FloatArray, IntArray, edge_lengths, unique_edges

MAX_HALVINGS = 20
"""Rounds of halving, enough for edges a million times too long (2²⁰)."""


def split_long_edges(
    vertices: FloatArray, faces: IntArray, longest: float, most_vertices: int
) -> tuple[FloatArray, IntArray, IntArray]:
    """Halve edges until none is longer than `longest`, or the next round would exceed `most_vertices`.

    Returns
    -------
    (n', 3) vertices, the old ones first; (m', 3) faces; and (m',) index of the old face that contains each new one.
    """
    parent = np.arange(len(faces))
    for _ in range(MAX_HALVINGS):
        if edge_lengths(vertices, faces).max() <= longest:
            break
        edges, which, _ = unique_edges(faces)
        too_long = np.linalg.norm(vertices[edges[:, 0]] - vertices[edges[:, 1]], axis=1) > longest
        if len(vertices) + too_long.sum() > most_vertices:
            break
        middle = np.full(len(edges), -1)
        middle[too_long] = len(vertices) + np.arange(too_long.sum())
        vertices = np.concatenate([vertices, vertices[edges[too_long]].mean(axis=1)])
        faces, old_face = split_faces(faces, middle[which.reshape(-1, 3)], vertices)
        parent = parent[old_face]
    return vertices, faces, parent


def split_faces(faces: IntArray, middles: IntArray, vertices: FloatArray) -> tuple[IntArray, IntArray]:
    """Split triangles at the middles of their edges ab, bc and ca.

    Parameters
    ----------
    faces : (m, 3) int array
    middles : (m, 3) int array
        Vertex in the middle of each edge; -1: this edge is not split.
    vertices : (n, 3) array
        Positions, those of the middles included.

    Returns
    -------
    (m', 3) new triangles, and (m',) index of the old triangle that contains each; those of one old triangle are
    consecutive.
    """
    n_splits = (middles >= 0).sum(axis=1)
    # Rotate each triangle so that its only split edge, or its only edge that is not split, comes first.
    first = np.where(n_splits == 1, (middles >= 0).argmax(axis=1), (middles < 0).argmax(axis=1))
    turn = (first[:, None] + np.arange(3)) % 3
    a, b, c = np.take_along_axis(faces, turn, axis=1).T
    ab, bc, ca = np.take_along_axis(middles, turn, axis=1).T
    whole, one, two, three = (np.flatnonzero(n_splits == k) for k in range(4))
    # Two split edges leave a quadrilateral a b bc ca, which is split along its shorter diagonal.
    across = np.linalg.norm(vertices[a[two]] - vertices[bc[two]], axis=1)
    shorter = across <= np.linalg.norm(vertices[b[two]] - vertices[ca[two]], axis=1)
    via_a, via_b = two[shorter], two[~shorter]
    triangles = [
        (whole, (a, b, c)),
        (one, (a, ab, c)), (one, (ab, b, c)),
        (two, (bc, c, ca)),
        (via_a, (a, b, bc)), (via_a, (a, bc, ca)),
        (via_b, (a, b, ca)), (via_b, (b, bc, ca)),
        (three, (a, ab, ca)), (three, (ab, b, bc)), (three, (bc, c, ca)), (three, (ab, bc, ca)),
    ]  # fmt: skip
    parent = np.concatenate([rows for rows, _ in triangles])
    corners = np.concatenate([np.stack([corner[rows] for corner in abc], axis=1) for rows, abc in triangles])
    order = np.argsort(parent, kind="stable")
    return corners[order], parent[order]
