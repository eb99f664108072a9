"""The connected pieces of a part, which splitting makes parts of their own."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.spatial import cKDTree

from ...core.mesh.triangle_mesh import FloatArray, IntArray, components_of_pairs
from ..scene.attributes import read_floats
from ..scene.characters import Character
from ..scene.mesh_arrays import Body
from ..scene.poses import polygon_ranges
from ..scene.topology import neighbors
from .labels import labels_on


def pieces_of(characters: Sequence[Character], part: int, least_share: float) -> dict[Character, IntArray]:
    """For each polygon of each character the piece of a part that it is in, −1 if it is not of that part.

    Pieces are numbered alike on all characters, the largest of the first 0. One below a share of a character's area
    belongs to the nearest larger one.
    """
    found: dict[Character, IntArray] = {}
    for character in characters:
        mine = _pieces(character, part, least_share)
        for other, known in found.items():
            mine = _numbered_as(character, mine, other, known)
            break
        found[character] = mine
    return found


def _pieces(character: Character, part: int, least_share: float) -> IntArray:
    pairs, labels, areas = [], [], []
    for obj, polygons in polygon_ranges(character):
        on_mesh = labels_on(obj.data)
        labels.append(np.full(polygons.stop - polygons.start, -1) if on_mesh is None else on_mesh)
        pairs.append(polygons.start + neighbors(obj.data))
        areas.append(read_floats(obj.data.polygons, "area"))
    label, area = np.concatenate(labels), np.concatenate(areas).astype(np.float64)
    pair = np.concatenate(pairs)
    inside = pair[(label[pair] == part).all(axis=1)]
    count = len(label)
    polygons_in = np.flatnonzero(label == part)
    result = np.full(count, -1)
    if not len(polygons_in):
        return result
    _, component = np.unique(components_of_pairs(inside, count)[polygons_in], return_inverse=True)
    size = np.bincount(component.ravel(), weights=area[polygons_in])
    order = np.argsort(-size, kind="stable")
    large = order[(size[order] >= least_share * area.sum()) | (np.arange(len(order)) == 0)]
    number = np.full(len(size), -1)
    number[large] = np.arange(len(large))
    piece = number[component.ravel()]
    if (piece < 0).any():
        center = Body.of(character).polygons[polygons_in]
        piece[piece < 0] = piece[piece >= 0][cKDTree(center[piece >= 0]).query(center[piece < 0])[1]]
    result[polygons_in] = piece
    return result


def _numbered_as(character: Character, pieces: IntArray, other: Character, known: IntArray) -> IntArray:
    """Pieces with the numbers of those of another character which they correspond to; others get new ones.

    Where the polygons are the same, by the polygons in common; elsewhere by where they are in the whole.
    """
    count, n_known = int(pieces.max(initial=-1)) + 1, int(known.max(initial=-1)) + 1
    if not count or not n_known:
        return pieces
    if len(pieces) == len(known):
        cost = np.zeros((count, n_known))
        both = (pieces >= 0) & (known >= 0)
        np.add.at(cost, (pieces[both], known[both]), -1.0)
    else:
        here, there = _middles(character, pieces, count), _middles(other, known, n_known)
        cost = np.linalg.norm(here[:, None] - there, axis=2)
    number = np.full(count, -1)
    rows, columns = linear_sum_assignment(cost)
    number[rows] = columns
    number[number < 0] = n_known + np.arange((number < 0).sum())
    return np.where(pieces < 0, -1, number[pieces])


def _middles(character: Character, pieces: IntArray, count: int) -> FloatArray:
    """(count, 3) where the middle of each piece is, from 0 to 1 along each side of the character's box."""
    places_of = Body.of(character).polygons
    extent = np.ptp(places_of, axis=0)
    unit = (places_of - places_of.min(axis=0)) / np.where(extent > 0, extent, 1)
    return np.array([unit[pieces == piece].mean(axis=0) for piece in range(count)])
