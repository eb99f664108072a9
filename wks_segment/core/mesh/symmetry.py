"""The mirror plane of a body, from its shape alone."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial import cKDTree

from .triangle_mesh import FloatArray, TriangleMesh

MIRRORED_POINTS = 3_000
"""Number of points whose mirror images are looked up: more change the mean distance by less than a tenth."""
SPACING, MOST_GRID_STEPS = 0.1, 30
"""Points on large faces are this far apart, in units of the square root of the area, on a grid of at most so many
steps: the faces of a box have points to compare, and a mesh of needles does not fill the memory."""
FAR = 0.1
"""Distance, in units of the square root of the area, beyond which a mirror image counts as having no counterpart."""
SYMMETRIC = 0.005
"""Mean distance of mirror images below which a plane may replace the preferred one, if that is above: of 22 rigged
characters the plane between left and right is below 0.001 if they are as good as symmetric, and every plane between
front and back or above and below is over 0.007."""
CLEARLY_BETTER = 0.3
"""And below this fraction of the preferred one's: it is at most 0.04 on the two rigs with a wrong axis, and at least
0.36 on the others, wherever another plane is better."""
ALONG = 0.5
"""Least cosine between a direction to the left and the normal: below, the direction says nothing about the side."""


def upright_axes(mesh: TriangleMesh, axes: FloatArray, left: Sequence[FloatArray] = ()) -> FloatArray:
    """(3, 3) axes of a body as columns, the first of which is the normal of its mirror plane and points to its left.

    Parameters
    ----------
    mesh : TriangleMesh
    axes : (3, 3) array
        The axes of its rig as columns. The first one is the normal unless the body is clearly more symmetric in another
        plane, and says which side is left if nothing else does.
    left : optional
        Directions to the left that are known better.
    """
    normal = mirror_normal(mesh, axes[:, 0], np.vstack([axes[:, 1:].T, np.eye(3)]))
    for direction in (*left, axes[:, 0], axes[:, 1], axes[:, 2]):
        cosine = float(direction @ normal) / (float(np.linalg.norm(direction)) or 1.0)
        if abs(cosine) >= ALONG:
            normal = normal * np.sign(cosine)
            break
    second = axes[:, 1] if abs(axes[:, 1] @ normal) < ALONG else axes[:, 2]
    second = second - (second @ normal) * normal
    second = second / np.linalg.norm(second)
    return np.column_stack([normal, second, np.cross(normal, second)])


def mirror_normal(mesh: TriangleMesh, preferred: FloatArray, others: FloatArray) -> FloatArray:
    """(3,) normal of the plane that mirrors a body best; its sign means nothing.

    Parameters
    ----------
    mesh : TriangleMesh
    preferred : (3,) array
        Unit normal that is taken unless another one is clearly better, as for a body that is not symmetric.
    others : (k, 3) array
        Further unit normals to try, beside the body's own principal axes, among which the normal of the mirror plane of
        an exactly symmetric body is.
    """
    normals = np.vstack([preferred, others, _principal_axes(mesh)])
    distances = mirror_distances(mesh, normals)
    best = int(distances.argmin())
    is_wrong = distances[0] >= SYMMETRIC
    is_clear = distances[best] < min(SYMMETRIC, CLEARLY_BETTER * distances[0])
    return np.asarray(normals[best] if is_wrong and is_clear else normals[0])


def mirror_distances(mesh: TriangleMesh, normals: FloatArray) -> FloatArray:
    """(k,) mean distance from the surface of its mirror images in planes through its center, given (k, 3) normals.

    In units of the square root of the area.
    """
    points, areas = _points_on(mesh)
    points = (points - np.average(points, axis=0, weights=areas)) / np.sqrt(mesh.area)
    tree = cKDTree(points)
    some = np.arange(0, len(points), max(1, len(points) // MIRRORED_POINTS))
    result = np.empty(len(normals))
    for i, normal in enumerate(normals):
        images = points[some] - 2 * np.outer(points[some] @ normal, normal)
        distance = tree.query(images, distance_upper_bound=FAR)[0]
        result[i] = np.average(np.minimum(distance, FAR), weights=areas[some])
    return result


def _points_on(mesh: TriangleMesh) -> tuple[FloatArray, FloatArray]:
    """(s, 3) points spread over a surface, and the area of each.

    They are the nodes of a grid on each triangle, so that a square has the same points along whichever diagonal it is
    cut.
    """
    corners, areas = mesh.vertices[mesh.faces], mesh.face_areas
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    steps = np.clip(np.ceil(longest / (SPACING * np.sqrt(mesh.area))), 1, MOST_GRID_STEPS).astype(int)
    points, weights = [], []
    for count in np.unique(steps):
        of = steps == count
        grid = np.array([(i, j, count - i - j) for i in range(count + 1) for j in range(count + 1 - i)]) / count
        points.append(np.einsum("gc,fcd->fgd", grid, corners[of]).reshape(-1, 3))
        weights.append(np.repeat(areas[of] / len(grid), len(grid)))
    return np.concatenate(points), np.concatenate(weights) + np.finfo(float).tiny


def _principal_axes(mesh: TriangleMesh) -> FloatArray:
    """(3, 3) principal axes of a surface, as rows.

    They are of all its points, not of its vertices like those of `canonical.Frame`, which depend on the diagonals that
    squares are cut along: by 1° on a figure of boxes, so that its mirror plane would not be found.
    """
    weights = mesh.face_areas / mesh.area
    corners = mesh.vertices[mesh.faces] - weights @ mesh.face_centers
    points = np.concatenate([corners.reshape(-1, 3), 3 * corners.mean(axis=1)])
    # The integral of x xᵀ over a triangle is its area / 12 times the sum over its corners and over their sum.
    of_points = np.concatenate([np.repeat(weights, 3), weights])
    return np.asarray(np.linalg.eigh((points * of_points[:, None]).T @ points)[1].T)
