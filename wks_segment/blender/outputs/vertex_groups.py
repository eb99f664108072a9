"""Writes weights to a mesh as vertex groups and takes them back. Which are ours stands in the note on the mesh."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from itertools import chain, count
from typing import Any

import bpy
import numpy as np

from ...core.mesh.triangle_mesh import FloatArray
from ..parts import part_ids
from ..parts.part_style import Style

NAME = "WKS {}"
"""Not the bare name of our materials: bones, attributes and vertex groups share their names."""


def write_groups(
    mesh: bpy.types.Mesh, weights: Mapping[int, FloatArray], note: Any, style: Style, shown: str | None = None
) -> None:  # fmt: skip
    """Add a vertex group for each part whose (n,) weights are not all 0, behind the mesh's own.

    Parameters
    ----------
    weights
        0 to 1; a vertex is in a group only where its weight is above 0.
    note
        Dict-like, and kept with the mesh; gets the names of the groups and of the one that is active now.
    shown
        Name of the group that is active afterwards, if there is one of this name; else the one that is active now.
    """
    with _holder(mesh) as holder:
        active = holder.vertex_groups.active
        note["active_group"] = active.name if active is not None else ""
        found = part_ids.unique_parts(
            np.array([part for part, of_part in weights.items() if of_part.any()], dtype=np.int64)
        )
        names = [NAME.format(style.name_of(part)) for part in found]
        groups = [holder.vertex_groups.new(name=_free_name(holder, name)) for name in names]
        note["own_groups"] = [group.name for group in holder.vertex_groups if group not in groups]
        note["vertex_groups"] = [group.name for group in groups]
        note["group_parts"] = found
        for part, group in zip(found, groups, strict=True):
            _fill(group, weights[part].astype(np.float32))
        _activate(holder, shown, note["active_group"], *note["vertex_groups"])


def remove_groups(mesh: bpy.types.Mesh, note: dict[str, Any]) -> None:
    """Remove the groups that `write_groups` noted; one that was renamed since is the user's, and stays."""
    ours = note.get("vertex_groups", [])
    if not ours:
        return
    with _holder(mesh) as holder:
        active = holder.vertex_groups.active
        shown = active.name if active is not None and active.name not in ours else note.get("active_group")
        for name in ours:
            group = holder.vertex_groups.get(name)
            if group is not None:
                holder.vertex_groups.remove(group)
        _activate(holder, shown)


def read_groups(mesh: bpy.types.Mesh, note: Mapping[str, Any]) -> dict[int, FloatArray]:
    """For each part that has a group of ours, the (n,) weights in it."""
    found: dict[int, tuple[int, FloatArray]] = {}
    with _holder(mesh) as holder:
        for name, part in zip(note.get("vertex_groups", []), note.get("group_parts", []), strict=False):
            group = holder.vertex_groups.get(name)
            if group is not None:
                found[group.index] = part, np.zeros(len(mesh.vertices))
    for i, vertex in enumerate(mesh.vertices):
        for member in vertex.groups:
            if member.group in found:
                found[member.group][1][i] = member.weight
    return dict(found.values())


def rename_group(mesh: bpy.types.Mesh, note: Any, part: int, style: Style) -> None:
    """Call the group of a part, if there is one of ours, as the style does."""
    names = list(note.get("vertex_groups", []))
    of_part = dict(zip(note.get("group_parts", []), range(len(names)), strict=False))
    with _holder(mesh) as holder:
        group = holder.vertex_groups.get(names[of_part[part]]) if part in of_part else None
        wanted = NAME.format(style.name_of(part))
        if group is not None and group.name != wanted:
            group.name = _free_name(holder, wanted)
            names[of_part[part]] = group.name
            note["vertex_groups"] = names


def active_group(mesh: bpy.types.Mesh) -> str | None:
    """Name of the active vertex group, if any."""
    with _holder(mesh) as holder:
        active = holder.vertex_groups.active
        return None if active is None else active.name


def our_groups(mesh: bpy.types.Mesh, note: dict[str, Any]) -> dict[str, int]:
    """Names of the groups that `write_groups` noted and that are still there, and the part of each."""
    with _holder(mesh) as holder:
        there = holder.vertex_groups.keys()
        pairs = zip(note.get("vertex_groups", []), note.get("group_parts", []), strict=False)
        return {name: part for name, part in pairs if name in there}


def group_weights(mesh: bpy.types.Mesh) -> dict[str, FloatArray]:
    """(n,) weights of each vertex group; 0 for vertices that are not in it."""
    with _holder(mesh) as holder:
        names = holder.vertex_groups.keys()
    weights = np.zeros((len(names), len(mesh.vertices)))
    for vertex in mesh.vertices:
        for member in vertex.groups:
            weights[member.group, vertex.index] = member.weight
    return dict(zip(names, weights, strict=True))


def free_name(mesh: bpy.types.Mesh, name: str) -> str:
    """The name, or with a number if an attribute or a vertex group has it."""
    with _holder(mesh) as holder:
        return _free_name(holder, name)


@contextmanager
def _holder(mesh: bpy.types.Mesh) -> Iterator[bpy.types.Object]:
    """An object of the mesh, for as long as it lasts: groups belong to the mesh, but are reached through objects."""
    holder = bpy.data.objects.new("", mesh)
    try:
        yield holder
    finally:
        bpy.data.objects.remove(holder)


def _free_name(holder: bpy.types.Object, name: str) -> str:
    # Blender numbers among groups and among attributes, but not between them: it makes no attribute with the name of a
    # group, and lets a group take that of an attribute.
    taken = {*holder.vertex_groups.keys(), *holder.data.attributes.keys()}
    return next(free for free in chain([name], (f"{name}.{i:03}" for i in count(1))) if free not in taken)


def _fill(group: bpy.types.VertexGroup, weights: FloatArray) -> None:
    """Put (n,) weights above 0 into an empty group, in one call for each distinct weight."""
    members = np.flatnonzero(weights)
    members = members[np.argsort(weights[members], kind="stable")]
    distinct, first = np.unique(weights[members], return_index=True)
    for weight, vertices in zip(distinct.tolist(), np.split(members, first[1:]), strict=True):
        group.add(vertices.tolist(), weight, "REPLACE")


def _activate(holder: bpy.types.Object, *names: str | None) -> None:
    """Make the first group of these names that is there the active one."""
    for name in names:
        if name and name in holder.vertex_groups:
            holder.vertex_groups.active_index = holder.vertex_groups[name].index
            return
