"""Left and right: the side of each learned region, and of each part of a pose by the sides of its regions.

The sides of learned regions are read from the mesh at rest, once. In any other pose a region has the side of the
learned region that it is matched with: `traits` measures the handedness that tells a hand from its mirror image,
`matching` compares it.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

from ..mesh.adjacency import FaceAdjacency, connected_regions
from ..mesh.surface import Surface, shares_at_vertices
from ..mesh.triangle_mesh import BoolArray, FloatArray, IntArray
from ..poses.pose_cache import Kind, ResultKey, Workpiece
from .traits import LEAST_OVERLAP

SIMILAR_AREA = 0.5
"""Regions on two sides are a pair if the smaller one has at least this fraction of the area of the larger one: a tail
is no counterpart of a foot."""
MIDDLE = 0.05
"""Regions whose distance across the mirror plane is smaller than this, in units of the square root of the area, are
neither left nor right."""
BENT_MIDDLE = 0.1
"""The same distance for bent poses, in which mirroring brings no region close to its counterpart."""
SIDE_SURROUNDINGS = 0.15
"""Radius, in the same unit, within which sides of learned regions decide on the side of a face."""
CLEAR_SIDE = 0.5
"""A region is left or right if the mean of `side_field` is beyond this: three times more heat from one side than from
the other."""


def region_sides(centers: FloatArray, segment: IntArray, mirrored: IntArray) -> IntArray:
    """(r,) 1 for regions on the left, −1 on the right, and 0 for regions without a counterpart on the other side.

    The counterpart is the region of the same segment that mirroring brings closest. For bent or turned poses, it is the
    region that this one becomes in the mirror image.

    Parameters
    ----------
    centers : (r, 3) array
        Centers of the regions in units of the square root of the area; the mirror plane is x = 0.
    segment : (r,) int array
    mirrored : (r,) int array
        Region that each one becomes in the mirror image; r or more for none.
    """
    distances = cdist(centers * (-1, 1, 1), centers)
    distances[segment[:, None] != segment] = np.inf
    nearest = distances.argmin(axis=1)
    across = centers[:, 0] * centers[nearest, 0] < 0
    side = _side_of_pairs(centers[:, 0], nearest, MIDDLE) * across
    counterpart = np.where(mirrored < len(segment), mirrored, np.arange(len(segment)))
    undecided = (side == 0) & (side[counterpart] == 0)
    return np.where(undecided, _side_of_pairs(centers[:, 0], counterpart, BENT_MIDDLE), side)


def _side_of_pairs(x: FloatArray, counterpart: IntArray, least: float) -> IntArray:
    """(r,) 1 or −1 where two regions are counterparts of each other and more than `least` apart in x; 0 elsewhere."""
    apart = x - x[counterpart]
    mutual = counterpart[counterpart] == np.arange(len(x))
    return np.where(mutual & (np.abs(apart) > least), np.sign(apart), 0).astype(int)


def side_field(pose: Workpiece, side: IntArray) -> FloatArray:
    """(m,) value of each face from 1 on the left to −1 on the right, given the side of the region of each face.

    It is the share of heat from the left minus the share from the right. So a face that is far from both, such as on a
    tail, is as clearly in the middle as one that lies between them.
    """
    inside = shares_at_vertices(pose.surface, side % 3, 3)[:, 1:]
    left, right = np.maximum(pose.flows.over(SIDE_SURROUNDINGS).smooth(inside), 0).T
    return pose.surface.to_faces(((left - right) / np.maximum(left + right, LEAST_OVERLAP))[:, None])[:, 0]


def sides_in_pose(
    pose: Workpiece, field: FloatArray, polygon_of: IntArray, labels: IntArray, min_share: float
) -> IntArray:
    """(p,) side of each polygon in one pose; see `sides_of_regions`."""
    neighbors = pose.results.get(
        ResultKey(Kind.POLYGON_NEIGHBORS, polygons=True),
        (polygon_of,),
        lambda: pose.neighbors.between_polygons(polygon_of),
    )
    return sides_of_regions(pose.surface, field, polygon_of, labels, min_share, neighbors)


def sides_of_regions(
    surface: Surface,
    field: FloatArray,
    polygon_of: IntArray,
    labels: IntArray,
    min_share: float,
    neighbors: FaceAdjacency,
) -> IntArray:
    """(p,) side of each polygon: 1 left, −1 right, 0 where its region has no counterpart with the same label.

    Parameters
    ----------
    surface : Surface
    field : (m,) array
        Result of `side_field`.
    polygon_of : (m,) int array
        Polygon of each face, −1 for none.
    labels : (p,) int array
        Of the polygons.
    min_share : float
        Regions with less than this share of the area take the side of the nearest large region with their label.
    neighbors : FaceAdjacency
        Of the polygons.
    """
    original = surface.original
    region = connected_regions(labels, neighbors)
    count = int(region.max()) + 1
    label_of = np.zeros(count, dtype=np.int64)
    label_of[region] = labels
    seen = polygon_of >= 0
    region_of_face, weights = region[polygon_of[seen]], original.face_areas[seen]
    area = np.bincount(region_of_face, weights, count).astype(np.float64)
    sums = np.bincount(region_of_face, weights * field[seen], count)
    mean: FloatArray = sums / np.maximum(area, np.finfo(float).tiny)
    large = area >= min_share * original.area
    side = np.zeros(count, dtype=np.int64)
    clear = np.flatnonzero(large & (np.abs(mean) > CLEAR_SIDE))
    side[clear] = np.sign(mean[clear]) * have_counterpart(area[clear], mean[clear], label_of[clear])
    centers = original.face_centers[seen]
    for label in np.unique(label_of[~large]):
        in_large = np.flatnonzero(large[region_of_face] & (label_of[region_of_face] == label))
        in_small = np.flatnonzero(~large[region_of_face] & (label_of[region_of_face] == label))
        if len(in_large) and len(in_small):
            nearest = cKDTree(centers[in_large]).query(centers[in_small])[1]
            side[region_of_face[in_small]] = side[region_of_face[in_large[nearest]]]
    return np.asarray(side[region])


def have_counterpart(area: FloatArray, mean: FloatArray | IntArray, label: IntArray) -> BoolArray:
    """(r,) whether each region has one of about its area, with its label, on the other side."""
    similar = np.minimum.outer(area, area) >= SIMILAR_AREA * np.maximum.outer(area, area)
    opposite = (label[:, None] == label) & (np.outer(mean, mean) < 0)
    return np.asarray((similar & opposite).any(axis=1))
