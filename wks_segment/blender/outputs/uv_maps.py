"""A UV map of ours in addition to the artist's own."""

from __future__ import annotations

import bpy

from ...core.mesh.triangle_mesh import FloatArray
from ..errors import UserError
from ..scene.attributes import write_floats
from ..scene.vertex_group_access import free_name
from .ledger import Ledger

UV_MAP_NAME = "WKS Segment"
MOST_UV_MAPS = 8
"""Blender holds no more UV maps on a mesh."""


class UvMap:
    """The UV map that Unwrap Segments and Bake ID Map write."""

    keys = ("uv_map", "active_uv")

    def take_back(self, mesh: bpy.types.Mesh, ledger: Ledger) -> None:
        """Remove the UV map; one that was renamed since is the user's, and stays."""
        layer = mesh.uv_layers.get(ledger.get("uv_map", ""))
        if layer is None:
            return
        active = mesh.uv_layers.active.name
        active = ledger.get("active_uv", "") if active == layer.name else active
        rendered = next((other.name for other in mesh.uv_layers if other.active_render), "")
        mesh.uv_layers.remove(layer)
        for other in mesh.uv_layers:
            if other.name == rendered:
                other.active_render = True
        if active in mesh.uv_layers:
            mesh.uv_layers.active = mesh.uv_layers[active]


def write_uv_map(mesh: bpy.types.Mesh, uvs: FloatArray) -> None:
    """Write (corners, 2) UVs to our UV map, which is added if it is not there, and make it the active one."""
    ledger = Ledger(mesh)
    layer = mesh.uv_layers.get(ledger.get("uv_map", ""))
    if layer is None:
        check_room_for_uv_map(mesh)
        active = mesh.uv_layers.active
        ledger["active_uv"] = "" if active is None else active.name
        layer = mesh.uv_layers.new(name=free_name(mesh, UV_MAP_NAME), do_init=False)
        ledger["uv_map"] = layer.name
    write_floats(layer.data, "uv", uvs)
    mesh.uv_layers.active = layer
    mesh.update()


def check_room_for_uv_map(mesh: bpy.types.Mesh) -> None:
    """UserError if no UV map can be added to a mesh."""
    if len(mesh.uv_layers) >= MOST_UV_MAPS:
        raise UserError(
            '"{name}" has {count} UV maps, more cannot be added: remove one first', name=mesh.name, count=MOST_UV_MAPS
        )
