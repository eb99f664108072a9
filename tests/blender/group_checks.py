"""Vertex groups of objects, read to be compared."""

import bpy
import numpy as np
from builders import (
    select,
)

from wks_segment.blender.scene import poses as reader
from wks_segment.blender.scene.characters import Character
from wks_segment.core import PoseSegmentation

OPS = bpy.ops.wks_segment


def groups_of(obj):
    """Vertex groups of an object: name, whether it is locked, and (n,) weights, NaN for vertices that are not in it."""
    weights = np.full((len(obj.vertex_groups), len(obj.data.vertices)), np.nan)
    for vertex in obj.data.vertices:
        for member in vertex.groups:
            weights[member.group, vertex.index] = member.weight
    return {group.name: (group.lock_weight, weights[group.index].tobytes()) for group in obj.vertex_groups}


def weights_of(obj, names=None):
    """(n, k) weights in the groups of these names, ours if not given; 0 for vertices that are not in one."""
    groups = groups_of(obj)
    names = [name for name in groups if name.startswith("WKS Segment")] if names is None else names
    return np.nan_to_num(np.stack([np.frombuffer(groups[name][1]) for name in names], axis=1))


def ours(obj):
    return [name for name in obj.vertex_groups.keys() if name.startswith("WKS Segment")]  # noqa: SIM118


def learned(settings, kind, *objects):
    settings.vertex_groups = kind
    select(*objects)
    assert OPS.learn() == {"FINISHED"}


def fitted(obj):
    """A model of 4 segments of an object as it is, and the pose."""
    (pose,) = reader.read_objects(bpy.context, [Character((obj,))])
    return PoseSegmentation(n_segments=4, n_eigenpairs=30, n_energies=40).fit([pose.mesh]), pose


def faces_around(mesh):
    """The faces of each vertex."""
    around = [[] for _ in mesh.vertices]
    for polygon in mesh.polygons:
        for vertex in polygon.vertices:
            around[vertex].append(polygon.index)
    return around


def read(obj):
    return reader.read_objects(bpy.context, [Character((obj,))])[0]
