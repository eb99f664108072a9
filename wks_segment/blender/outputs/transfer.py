"""Parts from one object to another by the nearest surface, both as they are seen."""

from __future__ import annotations

import numpy as np
from mathutils.bvhtree import BVHTree

from ...core.mesh.triangle_mesh import IntArray
from ..scene.poses import Pose
from .labels import labels_on


def transferred(source: Pose, target: Pose) -> IntArray:
    """(p,) part of each polygon of a pose, that of the nearest surface of another one at most of its area; −1 unseen.

    Parameters
    ----------
    source
        Of one object, whose mesh has labels.
    """
    labels = labels_on(source.character.objects[0].data)
    known = source.polygon_of >= 0
    tree = BVHTree.FromPolygons(source.mesh.vertices.tolist(), source.mesh.faces[known].tolist())
    middles = target.mesh.face_centers
    nearest = np.array([tree.find_nearest(middle)[2] for middle in middles.tolist()])
    assert labels is not None
    found, column = np.unique(labels[source.polygon_of[known][nearest]], return_inverse=True)
    of_own = target.polygon_of >= 0
    share = np.zeros((int(target.polygon_of.max()) + 1, len(found)))
    np.add.at(share, (target.polygon_of[of_own], column.ravel()[of_own]), target.mesh.face_areas[of_own])
    seen = np.zeros(len(share), dtype=bool)
    seen[target.polygon_of[of_own]] = True
    return np.where(seen, found[share.argmax(axis=1)], -1)
