"""The regions of a part (its connected components on a character), which Split makes parts of their own."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...core.mesh.triangle_mesh import FloatArray, IntArray, connected_groups
from ..scene.attributes import read_floats
from ..scene.characters import Character, polygon_ranges
from ..scene.mesh_arrays import Body
from ..scene.topology import neighbors
from .part_attributes import labels_on


def regions_of(characters: Sequence[Character], part: int, least_share: float) -> dict[Character, IntArray]:
    """(p,) region of a part that each polygon of each character is in, −1 outside of the part.

    Regions have the same numbers on all characters; the largest one of the first character is 0. A region below
    `least_share` of the character's area belongs to the nearest larger one.
    """
    result: dict[Character, IntArray] = {}
    for character in characters:
        regions = _regions(character, part, least_share)
        if result:
            first, known = next(iter(result.items()))
            regions = _numbered_like(character, regions, first, known)
        result[character] = regions
    return result


def _regions(character: Character, part: int, least_share: float) -> IntArray:
    """(p,) region of each polygon of one character, from the largest region; −1 outside of the part."""
    import scipy

    labels, areas, pairs = _polygons_of(character)
    count = len(labels)
    polygons = np.flatnonzero(labels == part)
    result = np.full(count, -1)
    if not len(polygons):
        return result
    inside = pairs[(labels[pairs] == part).all(axis=1)]
    _, component = np.unique(connected_groups(inside, count)[polygons], return_inverse=True)
    component = component.ravel()
    area = np.bincount(component, weights=areas[polygons])
    order = np.argsort(-area, kind="stable")
    large = order[(area[order] >= least_share * areas.sum()) | (np.arange(len(order)) == 0)]
    number = np.full(len(area), -1)
    number[large] = np.arange(len(large))
    regions = number[component]
    if (regions < 0).any():
        centers = Body.of(character).polygon_centers[polygons]
        nearest = scipy.spatial.cKDTree(centers[regions >= 0]).query(centers[regions < 0])[1]
        regions[regions < 0] = regions[regions >= 0][nearest]
    result[polygons] = regions
    return result


def _polygons_of(character: Character) -> tuple[IntArray, FloatArray, IntArray]:
    """(p,) part and (p,) area of each polygon of a character, and (q, 2) neighbors."""
    labels, areas, pairs = [], [], []
    for obj, polygons in polygon_ranges(character):
        on_mesh = labels_on(obj.data)
        labels.append(np.full(polygons.stop - polygons.start, -1) if on_mesh is None else on_mesh)
        areas.append(read_floats(obj.data.polygons, "area"))
        pairs.append(polygons.start + neighbors(obj.data))
    return np.concatenate(labels), np.concatenate(areas).astype(np.float64), np.concatenate(pairs)


def _numbered_like(character: Character, regions: IntArray, other: Character, known: IntArray) -> IntArray:
    """Regions with the numbers of the corresponding regions of another character; the remaining ones get new numbers.

    Regions correspond by the polygons that they have in common if the characters have the same number of polygons, else
    by their place within the character.
    """
    import scipy

    count, n_known = int(regions.max(initial=-1)) + 1, int(known.max(initial=-1)) + 1
    if not count or not n_known:
        return regions
    if len(regions) == len(known):
        cost = np.zeros((count, n_known))
        both = (regions >= 0) & (known >= 0)
        np.add.at(cost, (regions[both], known[both]), -1.0)
    else:
        places, known_places = _places(character, regions, count), _places(other, known, n_known)
        cost = np.linalg.norm(places[:, None] - known_places, axis=2)
    number = np.full(count, -1)
    rows, columns = scipy.optimize.linear_sum_assignment(cost)
    number[rows] = columns
    number[number < 0] = n_known + np.arange((number < 0).sum())
    return np.where(regions < 0, -1, number[regions])


def _places(character: Character, regions: IntArray, count: int) -> FloatArray:
    """(count, 3) center of each region, from 0 to 1 along each axis of the character's bounding box."""
    centers = Body.of(character).polygon_centers
    extent = np.ptp(centers, axis=0)
    unit = (centers - centers.min(axis=0)) / np.where(extent > 0, extent, 1)
    return np.array([unit[regions == region].mean(axis=0) for region in range(count)])
