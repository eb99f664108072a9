"""Motion: how each region turns from pose to pose, and how far two regions turn apart.

The rotation that brings a region from one pose into another is read from sums over its faces (Kabsch, 1976). The sums
of two regions add up, so that the turn between any two regions costs one singular value decomposition. Early methods
cut where rotations differ (James and Twigg, "Skinning mesh animations", 2005); here it is one piece of evidence beside
others.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from ..mesh.surface import indicator
from ..mesh.triangle_mesh import FloatArray, IntArray, TriangleMesh

MOST_PAIRS = 10
"""Maximum number of pairs of poses whose rotations are compared: all pairs of five poses."""
OWN_CHANGE = 0.5
"""Share of the squared angle by which the stiffer one of two regions deforms that does not count as their turn: soft
bodies and shears turn the sides of a limb apart, and are no joints. With 0 and with 1 the bones of 22 rigs are
less whole."""
APART = 0.1
"""Angle in radians by which two regions turn apart without doubt."""
STILL = 1e-4
"""Angles below this count as 0: rounding must not decide between equal regions."""


def pairs_of_poses(n_poses: int) -> list[tuple[int, int]]:
    """Pairs of poses whose rotations are compared: all, or `MOST_PAIRS` evenly drawn ones."""
    pairs = list(combinations(range(n_poses), 2))
    if len(pairs) <= MOST_PAIRS:
        return pairs
    return [pairs[i] for i in np.linspace(0, len(pairs) - 1, MOST_PAIRS).round().astype(int)]


def edge_correlations(poses: Sequence[TriangleMesh], region: IntArray) -> FloatArray:
    """(r, q, 3, 3) sums over the faces of each region of products of their edges in two poses, for q pairs of poses.

    Each face counts by its share of the area. Empty (q = 0) for a single pose.

    Parameters
    ----------
    poses
        Meshes with the same m faces.
    region : (m,) int array
        Region of each face, 0, 1, …, r − 1.
    """
    count = int(region.max()) + 1
    pairs = pairs_of_poses(len(poses))
    sums = np.zeros((count, len(pairs), 3, 3))
    frames = [_frames(pose) for pose in poses]
    areas = np.mean([pose.face_areas / pose.area for pose in poses], axis=0)
    collect = indicator(region, count)
    for q, (i, j) in enumerate(pairs):
        products = np.einsum("mki,mkj->mij", frames[j], frames[i]) * areas[:, None, None]
        sums[:, q] = (collect @ products.reshape(-1, 9)).reshape(count, 3, 3)
    return sums


def turns(first: FloatArray, second: FloatArray, first_area: FloatArray, second_area: FloatArray) -> FloatArray:
    """(k,) root mean square angle, in radians, by which two regions turn apart between poses; 0 for a single pose.

    Parameters
    ----------
    first, second : (k, q, 3, 3) arrays
        `edge_correlations` of the two regions of each of k pairs.
    first_area, second_area : (k,) arrays
        Their shares of the area.
    """
    if not first.shape[1]:
        return np.zeros(len(first))
    # What one common rotation explains less than two rotations do: two thirds of the reduced area times the squared
    # angle, because a rotation leaves its axis in place.
    alone = [_explained(one).mean(axis=1) for one in (first, second)]
    lost = 2 * (alone[0] + alone[1] - _explained(first + second).mean(axis=1))
    reduced = np.maximum(first_area * second_area / (first_area + second_area), np.finfo(float).tiny)
    # In the same way, what no rotation explains of a region is how far it deforms.
    areas = [np.maximum(area, np.finfo(float).tiny) for area in (first_area, second_area)]
    deformed = [3 * np.maximum(1 - one / area, 0) for one, area in zip(alone, areas, strict=True)]
    angle = np.sqrt(np.maximum(1.5 * lost / reduced - OWN_CHANGE * np.minimum(*deformed), 0))
    return np.where(angle < STILL, 0.0, angle)


def shares_turning(correlations: FloatArray, areas: FloatArray) -> FloatArray:
    """(r,) share of the area that turns apart from each region between poses: 0 where nothing moves, or for one pose.

    Parameters
    ----------
    correlations : (r, q, 3, 3) array
        `edge_correlations` of the regions.
    areas : (r,) array
    """
    if not correlations.shape[1]:
        return np.zeros(len(correlations))
    left, _, right = np.linalg.svd(correlations)
    left[..., 2] *= np.sign(np.linalg.det(left) * np.linalg.det(right))[..., None]
    rotations = left @ right
    cosines = np.clip((np.einsum("aqij,bqij->abq", rotations, rotations) - 1) / 2, -1, 1)
    angles = np.sqrt((np.arccos(cosines) ** 2).mean(axis=2))
    return np.asarray((1 - np.exp(-angles / APART)) @ areas / areas.sum())


def _explained(correlations: FloatArray) -> FloatArray:
    """(…,) trace of each correlation with the rotation that fits it best."""
    left, values, right = np.linalg.svd(correlations)
    mirrored = np.linalg.det(left) * np.linalg.det(right) < 0
    return np.asarray(values.sum(axis=-1) - 2 * values[..., 2] * mirrored)


def _frames(mesh: TriangleMesh) -> FloatArray:
    """(m, 4, 3) three edges and the normal of each face, scaled so that the sum of their squares is 1."""
    a, b, c = mesh.vertices[mesh.faces].transpose(1, 0, 2)
    normal = np.cross(b - a, c - a)
    length = np.maximum(np.linalg.norm(normal, axis=1), np.finfo(float).tiny)
    # As long as the edges of a right triangle with the area of the face, so that flat faces have a full rotation.
    normal = normal / np.sqrt(length)[:, None]
    frames = np.stack([b - a, c - b, a - c, normal], axis=1)
    norm = np.sqrt(np.einsum("mki,mki->m", frames, frames))
    return np.asarray(frames / np.maximum(norm, np.finfo(float).tiny)[:, None, None])
