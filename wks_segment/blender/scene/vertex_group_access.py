"""Reaches the vertex groups of a mesh: they belong to the mesh, but Blender shows them only on objects."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from itertools import chain, count

import bpy
import numpy as np

from ...core.mesh.triangle_mesh import FloatArray


@contextmanager
def group_owner(mesh: bpy.types.Mesh) -> Iterator[bpy.types.Object]:
    """A temporary object of the mesh, to reach its vertex groups."""
    owner = bpy.data.objects.new("", mesh)
    try:
        yield owner
    finally:
        bpy.data.objects.remove(owner)


def active_group(mesh: bpy.types.Mesh) -> str | None:
    """Name of the active vertex group, if there is one."""
    with group_owner(mesh) as owner:
        active = owner.vertex_groups.active
        return None if active is None else active.name


def group_weights(mesh: bpy.types.Mesh) -> dict[str, FloatArray]:
    """(n,) weights of the vertices in each vertex group; 0 for vertices outside of it."""
    with group_owner(mesh) as owner:
        names = owner.vertex_groups.keys()
    weights = np.zeros((len(names), len(mesh.vertices)))
    for vertex in mesh.vertices:
        for member in vertex.groups:
            weights[member.group, vertex.index] = member.weight
    return dict(zip(names, weights, strict=True))


def free_name(mesh: bpy.types.Mesh, name: str) -> str:
    """The name, with a number added if an attribute or a vertex group of the mesh has it already."""
    with group_owner(mesh) as owner:
        return free_name_on(owner, name)


def free_name_on(owner: bpy.types.Object, name: str) -> str:
    """The same for the mesh of an object that is at hand."""
    # Blender numbers among groups and among attributes, but not between them: it makes no attribute with the name of a
    # group, but lets a group take the name of an attribute.
    taken = {*owner.vertex_groups.keys(), *owner.data.attributes.keys()}
    return next(free for free in chain([name], (f"{name}.{i:03}" for i in count(1))) if free not in taken)
