"""Splits long edges, so that every part of a surface is fine enough for the functions that are to live on it.

The surface stays what it is: new vertices lie on its edges. What an eigenfunction comes to on coarse triangles depends
on how coarse they are; on triangles that are all small enough, it depends on the surface alone, however it was meshed.
"""

from __future__ import annotations

import numpy as np

from .triangle_mesh import FloatArray, IntArray, edge_lengths, unique_edges

MAX_ROUNDS = 20
"""Rounds of halving: a millionfold."""


def split_long_edges(
    vertices: FloatArray, faces: IntArray, longest: float, most_vertices: int
) -> tuple[FloatArray, IntArray, IntArray]:
    """Halve edges until none is longer than `longest`, or the next round would bring more than `most_vertices`.

    Returns
    -------
    (n', 3) vertices, the old ones first; (m', 3) faces; and (m',) the old face that each new one is a piece of.
    """
    owner = np.arange(len(faces))
    for _ in range(MAX_ROUNDS):
        if edge_lengths(vertices, faces).max() <= longest:
            break
        edges, which, _ = unique_edges(faces)
        too_long = np.linalg.norm(vertices[edges[:, 0]] - vertices[edges[:, 1]], axis=1) > longest
        if len(vertices) + too_long.sum() > most_vertices:
            break
        middle = np.full(len(edges), -1)
        middle[too_long] = len(vertices) + np.arange(too_long.sum())
        vertices = np.concatenate([vertices, vertices[edges[too_long]].mean(axis=1)])
        faces, piece_of = cut(faces, middle[which.reshape(-1, 3)], vertices)
        owner = owner[piece_of]
    return vertices, faces, owner


def cut(faces: IntArray, middles: IntArray, vertices: FloatArray) -> tuple[IntArray, IntArray]:
    """Cut triangles at the middles of their edges ab, bc and ca (-1: this edge stays whole).

    Returns the pieces, and the triangle that each is a piece of.
    """
    n_cuts = (middles >= 0).sum(axis=1)
    # Turn each triangle so that the only cut edge, or the only whole one, is its first.
    first = np.where(n_cuts == 1, (middles >= 0).argmax(axis=1), (middles < 0).argmax(axis=1))
    turn = (first[:, None] + np.arange(3)) % 3
    a, b, c = np.take_along_axis(faces, turn, axis=1).T
    ab, bc, ca = np.take_along_axis(middles, turn, axis=1).T
    whole, one, two, three = (np.flatnonzero(n_cuts == k) for k in range(4))
    # Two cuts leave a quadrilateral a b bc ca, which its shorter diagonal cuts.
    across = np.linalg.norm(vertices[a[two]] - vertices[bc[two]], axis=1)
    shorter = across <= np.linalg.norm(vertices[b[two]] - vertices[ca[two]], axis=1)
    via_a, via_b = two[shorter], two[~shorter]
    pieces = [
        (whole, (a, b, c)),
        (one, (a, ab, c)), (one, (ab, b, c)),
        (two, (bc, c, ca)),
        (via_a, (a, b, bc)), (via_a, (a, bc, ca)),
        (via_b, (a, b, ca)), (via_b, (b, bc, ca)),
        (three, (a, ab, ca)), (three, (ab, b, bc)), (three, (bc, c, ca)), (three, (ab, bc, ca)),
    ]  # fmt: skip
    piece_of = np.concatenate([rows for rows, _ in pieces])
    cut = np.concatenate([np.stack([corner[rows] for corner in corners], axis=1) for rows, corners in pieces])
    order = np.argsort(piece_of, kind="stable")  # the pieces of a triangle together, as the triangles were
    return cut[order], piece_of[order]
