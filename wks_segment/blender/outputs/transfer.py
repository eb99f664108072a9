"""Transfers parts from one object to another by the nearest surface, both as they are seen."""

from __future__ import annotations

import numpy as np
from mathutils.bvhtree import BVHTree

from ...core.mesh.triangle_mesh import IntArray
from ..scene.poses import Pose
from .part_attributes import labels_on


def transfer_labels(source: Pose, target: Pose) -> IntArray:
    """(p,) part of each polygon of a pose: the part of the nearest surface of the source at most of its area.

    −1 for polygons that are not seen.

    Parameters
    ----------
    source
        Pose of a character of one object, whose mesh has labels.
    """
    labels = labels_on(source.character.objects[0].data)
    assert labels is not None
    known = source.polygon_of >= 0
    tree = BVHTree.FromPolygons(source.mesh.vertices.tolist(), source.mesh.faces[known].tolist())
    nearest = np.array([tree.find_nearest(center)[2] for center in target.mesh.face_centers.tolist()])
    parts, column = np.unique(labels[source.polygon_of[known][nearest]], return_inverse=True)
    is_own = target.polygon_of >= 0
    polygons = target.polygon_of[is_own]
    areas = np.zeros((int(target.polygon_of.max()) + 1, len(parts)))
    np.add.at(areas, (polygons, column.ravel()[is_own]), target.mesh.face_areas[is_own])
    seen = np.zeros(len(areas), dtype=bool)
    seen[polygons] = True
    return np.where(seen, parts[areas.argmax(axis=1)], -1)
