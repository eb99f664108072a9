"""Weights of parts as vertex groups."""

from __future__ import annotations

import bpy
import numpy as np

from ...core.mesh.triangle_mesh import FloatArray
from ..parts import part_ids
from ..parts.part_style import Style
from ..scene.vertex_group_access import free_name_on, group_owner
from .ledger import Ledger
from .output import PartsOfMesh

GROUP_NAME = "WKS {}"
"""Name of the group of a part. Not the part's name alone: a vertex group and an attribute cannot have the same name,
and an armature moves the vertices of a group that has the name of a bone."""


class VertexGroups:
    """A vertex group for each part that has weights, behind the mesh's own groups."""

    def write(self, mesh: bpy.types.Mesh, parts: PartsOfMesh, ledger: Ledger) -> None:
        """Add a group for each part whose (n,) weights are not all 0, if there are weights.

        Vertices are in a group only where their weight is above 0. The group that was active before the groups of
        earlier labels were taken back is active afterward, if there is one of its name.
        """
        if parts.weights is None:
            return
        with group_owner(mesh) as owner:
            active = owner.vertex_groups.active
            ledger["active_group"] = active.name if active is not None else ""
            weighted = [part for part, weights in parts.weights.items() if weights.any()]
            numbers = part_ids.unique_parts(np.array(weighted, dtype=np.int64))
            names = [GROUP_NAME.format(parts.options.style.name_of(part)) for part in numbers]
            groups = [owner.vertex_groups.new(name=free_name_on(owner, name)) for name in names]
            ledger["own_groups"] = [group.name for group in owner.vertex_groups if group not in groups]
            ledger["vertex_groups"] = [group.name for group in groups]
            ledger["group_parts"] = numbers
            for part, group in zip(numbers, groups, strict=True):
                _fill(group, parts.weights[part].astype(np.float32))
            _activate(owner, parts.active_group, ledger["active_group"], *ledger["vertex_groups"])

    def take_back(self, mesh: bpy.types.Mesh, ledger: Ledger) -> None:
        """Remove our groups; one that was renamed since is the user's, and stays."""
        names = ledger.get("vertex_groups", [])
        if not names:
            return
        with group_owner(mesh) as owner:
            active = owner.vertex_groups.active
            is_own = active is not None and active.name not in names
            shown = active.name if is_own else ledger.get("active_group", None)
            for name in names:
                group = owner.vertex_groups.get(name)
                if group is not None:
                    owner.vertex_groups.remove(group)
            _activate(owner, shown)


def read_groups(mesh: bpy.types.Mesh) -> dict[int, FloatArray]:
    """(n,) weights of the vertices in our group of each part."""
    by_index: dict[int, tuple[int, FloatArray]] = {}
    with group_owner(mesh) as owner:
        for name, part in our_groups(mesh).items():
            by_index[owner.vertex_groups[name].index] = part, np.zeros(len(mesh.vertices))
    for i, vertex in enumerate(mesh.vertices):
        for member in vertex.groups:
            if member.group in by_index:
                by_index[member.group][1][i] = member.weight
    return dict(by_index.values())


def our_groups(mesh: bpy.types.Mesh) -> dict[str, int]:
    """Names of our groups that are still there, and the part of each."""
    ledger = Ledger(mesh)
    with group_owner(mesh) as owner:
        present = owner.vertex_groups.keys()
    pairs = zip(ledger.get("vertex_groups", []), ledger.get("group_parts", []), strict=False)
    return {name: part for name, part in pairs if name in present}


def own_groups(mesh: bpy.types.Mesh) -> list[str]:
    """Names of the groups that the mesh had when ours were written."""
    return list(Ledger(mesh).get("own_groups", []))


def rename_group(mesh: bpy.types.Mesh, part: int, style: Style) -> None:
    """Give our group of a part, if there is one, the part's name in a style."""
    ledger = Ledger(mesh)
    names, numbers = list(ledger.get("vertex_groups", [])), list(ledger.get("group_parts", []))
    if part not in numbers[: len(names)]:
        return
    i = numbers.index(part)
    with group_owner(mesh) as owner:
        group = owner.vertex_groups.get(names[i])
        wanted = GROUP_NAME.format(style.name_of(part))
        if group is not None and group.name != wanted:
            group.name = free_name_on(owner, wanted)
            names[i] = group.name
            ledger["vertex_groups"] = names


def _fill(group: bpy.types.VertexGroup, weights: FloatArray) -> None:
    """Put vertices with (n,) weights above 0 into an empty group, in one call for each distinct weight."""
    members = np.flatnonzero(weights)
    members = members[np.argsort(weights[members], kind="stable")]
    distinct, first = np.unique(weights[members], return_index=True)
    for weight, vertices in zip(distinct.tolist(), np.split(members, first[1:]), strict=True):
        group.add(vertices.tolist(), weight, "REPLACE")


def _activate(owner: bpy.types.Object, *names: str | None) -> None:
    """Make the first group of these names that exists the active one."""
    for name in names:
        if name and name in owner.vertex_groups:
            owner.vertex_groups.active_index = owner.vertex_groups[name].index
            return
