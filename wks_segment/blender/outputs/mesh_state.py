"""What outputs can change of a mesh as it was, to bring it back in place: other data keep their references to it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ..scene.attributes import is_readable, read_attribute, read_bools, write_attribute, write_bools
from ..scene.fingerprint import OUR_PREFIX
from ..scene.vertex_group_access import group_owner
from .ledger import Ledger
from .material_slots import SlotState
from .seams import SEAM_ATTRIBUTES


@dataclass(frozen=True)
class _AttributeState:
    data_type: str
    domain: str
    values: NDArray[Any]


class MeshState:
    """Attributes, slots, vertex groups and our properties of a mesh. Outputs change no shape and no topology."""

    def __init__(self, mesh: bpy.types.Mesh) -> None:
        self._mesh = mesh
        self._attributes = _attributes(mesh)
        self._actives = _actives(mesh)
        self._seams = read_bools(mesh.edges, "use_seam")
        self._slots = SlotState(mesh)
        with group_owner(mesh) as owner:
            self._groups = [(group.name, group.lock_weight) for group in owner.vertex_groups]
            self._active_group = owner.vertex_groups.active_index
        # Weights of the artist's own groups are not changed: they are read only if all groups have to be made again.
        ours = set(Ledger(mesh).get("vertex_groups", []))
        self._weights = _weights(mesh, [name for name, _ in self._groups], ours) if ours else []
        self._properties = _our_properties(mesh)

    def restore(self) -> None:
        """Bring everything back. A mesh that is as it was is not touched: its simulation would lose its frames."""
        mesh = self._mesh
        if MeshState(mesh)._content() == self._content():
            return
        self._slots.restore(mesh)  # which changes the attribute of the faces' slots
        now = _attributes(mesh)
        for name, state in now.items():
            before = self._attributes.get(name)
            if before is None or (before.data_type, before.domain) != (state.data_type, state.domain):
                mesh.attributes.remove(mesh.attributes[name])
        self._restore_groups()
        for name, before in self._attributes.items():
            attribute = mesh.attributes.get(name)
            if attribute is None:
                attribute = mesh.attributes.new(name, before.data_type, before.domain)
            if name not in now or not np.array_equal(before.values, now[name].values):
                write_attribute(attribute, before.values)
        write_bools(mesh.edges, "use_seam", self._seams)
        for name in SEAM_ATTRIBUTES:
            if name in mesh.attributes and name not in self._attributes and not self._seams.any():
                mesh.attributes.remove(mesh.attributes[name])
        self._restore_actives()
        for name in _our_properties(mesh):
            del mesh[name]
        for name, value in self._properties.items():
            mesh[name] = value
        mesh.update()

    def _content(self) -> tuple[Any, ...]:
        """Everything, to be compared."""
        attributes = {
            name: (state.data_type, state.domain, state.values.tobytes()) for name, state in self._attributes.items()
        }
        groups = (self._groups, self._active_group, self._weights)
        return attributes, self._actives, self._seams.tobytes(), self._slots.content(), groups, self._properties

    def _restore_groups(self) -> None:
        """Make all vertex groups again, unless they are as they were."""
        mesh = self._mesh
        with group_owner(mesh) as owner:
            names = [group.name for group in owner.vertex_groups]
            removed = {name for _, name, _ in self._weights}
            is_same = [(group.name, group.lock_weight) for group in owner.vertex_groups] == self._groups
            if not is_same or _weights(mesh, names, removed) != self._weights:
                weights = [*_weights(mesh, names, {name for name, _ in self._groups} - removed), *self._weights]
                owner.vertex_groups.clear()
                for name, locked in self._groups:
                    owner.vertex_groups.new(name=name).lock_weight = locked
                for vertex, name, weight in weights:
                    owner.vertex_groups[name].add([vertex], weight, "REPLACE")
            if self._groups:
                owner.vertex_groups.active_index = self._active_group

    def _restore_actives(self) -> None:
        mesh, (colors, rendered_color, active_uv, rendered_uv, active) = self._mesh, self._actives
        for name, value in colors.items():
            setattr(mesh.attributes, name, value)
        if mesh.color_attributes.render_color_index != rendered_color >= 0:
            mesh.color_attributes.render_color_index = rendered_color
        for layer in mesh.uv_layers:
            if layer.name == active_uv:
                mesh.uv_layers.active = layer
            if layer.name == rendered_uv:
                layer.active_render = True
        mesh.attributes.active = mesh.attributes.get(active)


def _attributes(mesh: bpy.types.Mesh) -> dict[str, _AttributeState]:
    """The attributes that outputs can change: neither Blender's own topology nor selections."""
    found = {}
    for attribute in mesh.attributes:
        if is_readable(attribute) and attribute.name not in (*SEAM_ATTRIBUTES, "position"):
            values = read_attribute(mesh, attribute.name)
            assert values is not None
            found[attribute.name] = _AttributeState(attribute.data_type, attribute.domain, values)
    return found


def _actives(mesh: bpy.types.Mesh) -> tuple[dict[str, str], int, str, str, str]:
    """Which color attributes, UV maps and attribute are active, and which are rendered."""
    uv, attribute = mesh.uv_layers.active, mesh.attributes.active
    return (
        {name: getattr(mesh.attributes, name) for name in ("active_color_name", "default_color_name")},
        mesh.color_attributes.render_color_index,
        "" if uv is None else uv.name,
        next((layer.name for layer in mesh.uv_layers if layer.active_render), ""),
        "" if attribute is None else attribute.name,
    )


def _weights(mesh: bpy.types.Mesh, names: list[str], wanted: set[str]) -> list[tuple[int, str, float]]:
    """(vertex, group, weight) of the members of groups, given the names of all groups and of those that are wanted."""
    return [
        (vertex.index, names[member.group], member.weight)
        for vertex in mesh.vertices
        for member in vertex.groups
        if names[member.group] in wanted
    ]


def _our_properties(mesh: bpy.types.Mesh) -> dict[str, Any]:
    """Custom properties with names like ours."""
    return {
        name: value.to_dict() if hasattr(value, "to_dict") else value
        for name, value in mesh.items()
        if name.startswith(OUR_PREFIX)
    }
