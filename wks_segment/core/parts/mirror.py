"""Mirror symmetry of a mesh at rest: the face that is the mirror image of each face."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from ..mesh.triangle_mesh import FloatArray, IntArray, TriangleMesh

TOLERANCE, FACE_TOLERANCE = 0.003, 0.3
"""A face is the mirror image of another if its center is off by less than `TOLERANCE` of the size of the mesh plus
`FACE_TOLERANCE` times the root of its area: a quad may be cut along the other diagonal."""
LEAST_SHARE = 0.5
"""Least share of the area that must have a mirror image: below, likeness is a coincidence."""
EXACT_SHARE = 0.999
"""Share of the area with a mirror image above which a mesh is symmetric as a whole."""
OUTSIDE_PLANE = 0.03
"""Least mean distance of the faces from the mirror plane, in units of the square root of the area: a sheet is its own
mirror image in its plane, which says nothing."""


def mirrored_faces(mesh: TriangleMesh) -> IntArray | None:
    """(m,) mirror image of each face, −1 for a face without one; None for a mesh that is not symmetric.

    The mirror plane is perpendicular to an axis and lies in the middle of the mesh. Of several planes it is the one
    that mirrors most of the area, the first axis if they are alike.
    """
    centers, areas = mesh.face_centers, mesh.face_areas
    corners = mesh.vertices[np.unique(mesh.faces)]
    low, high = corners.min(axis=0), corners.max(axis=0)
    tolerance = TOLERANCE * float((high - low).max()) + FACE_TOLERANCE * np.sqrt(areas)
    tree = cKDTree(centers)
    best, best_share = None, LEAST_SHARE
    for axis in range(3):
        middle = (low[axis] + high[axis]) / 2
        if np.average(np.abs(centers[:, axis] - middle), weights=areas) < OUTSIDE_PLANE * np.sqrt(mesh.area):
            continue
        images = centers.copy()
        images[:, axis] = 2 * middle - images[:, axis]
        image = _mutual(tree, images, tolerance)
        share = float(areas[image >= 0].sum() / areas.sum())
        if share > best_share + 1e-6:
            best, best_share = image, share
    return best


def is_exact(image: IntArray | None, areas: FloatArray) -> bool:
    """Whether a mesh is its own mirror image as a whole."""
    return image is not None and bool(areas[image >= 0].sum() >= EXACT_SHARE * areas.sum())


def _mutual(tree: cKDTree, images: FloatArray, tolerance: FloatArray) -> IntArray:
    """(m,) face at the place of each image that in turn has this face as its image; −1 for none."""
    distance, nearest = tree.query(images)
    own = np.arange(len(images))
    near = distance < tolerance
    mutual = near & near[nearest] & (nearest[nearest] == own)
    return np.where(mutual, nearest, -1)
