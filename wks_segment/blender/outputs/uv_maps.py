"""A UV map of our own beside the artist's: unwrapped along the seams, packed by part, and taken back."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from math import radians
from typing import Any

import bmesh
import bpy
import numpy as np
from mathutils.geometry import box_pack_2d

from ...core.mesh.triangle_mesh import BoolArray, FloatArray, IntArray
from ..errors import UserError
from ..parts import part_ids
from ..scene.attributes import (
    new_attribute,
    read_attribute,
    read_bools,
    read_floats,
    read_ints,
    write_bools,
    write_floats,
)
from ..scene.topology import at_corners, border_edges, polygon_sizes
from .ledger import NOTE, note_of, open_note
from .vertex_groups import free_name

NAME = "WKS Segment"
MOST_MAPS = 8
"""Blender holds no more UV maps on a mesh."""
MARGIN = 0.004
"""Between two islands, in the width of the image: eight pixels of 2048."""
SMART_ANGLE = radians(66)
"""Blender's own default of Smart UV Project."""
SAME_PLACE = 1e-6
POLYGON, CORNER = "wks_segment_polygon", "wks_segment_corner"
"""Attributes of the copy that is unwrapped: which polygon and corner of the mesh each is."""
SMART = "SMART"
METHODS = (
    ("SEAMS", "Along Seams", "Only where there are seams. A segment that is closed, or a long tube, needs some"),
    (SMART, "Smart Project", "Where the surface turns, as Smart UV Project does"),
)
"""Where islands are cut beside the borders of segments, as an enum property takes it."""


def write_uv_map(mesh: bpy.types.Mesh, uvs: FloatArray) -> None:
    """Write (corners, 2) UVs to a new UV map, in the place of an earlier one of ours, and make it the active one."""
    note = note_of(mesh)
    if note.get("uv_map", "") in mesh.uv_layers:
        layer = mesh.uv_layers[note["uv_map"]]
    else:
        check_room(mesh)
        active = mesh.uv_layers.active
        open_note(mesh)["active_uv"] = "" if active is None else active.name
        layer = mesh.uv_layers.new(name=free_name(mesh, NAME), do_init=False)
        mesh[NOTE]["uv_map"] = layer.name
    write_floats(layer.data, "uv", uvs)
    mesh.uv_layers.active = layer
    mesh.update()


def remove_uv_map(mesh: bpy.types.Mesh, note: dict[str, Any]) -> None:
    """Remove the UV map that `write_uv_map` added; one that was renamed since is the user's, and stays."""
    layer = mesh.uv_layers.get(note.get("uv_map", ""))
    if layer is None:
        return
    shown = mesh.uv_layers.active.name
    shown = note["active_uv"] if shown == layer.name else shown
    rendered = next((other.name for other in mesh.uv_layers if other.active_render), "")
    mesh.uv_layers.remove(layer)
    for other in mesh.uv_layers:
        if other.name == rendered:
            other.active_render = True
    if shown in mesh.uv_layers:
        mesh.uv_layers.active = mesh.uv_layers[shown]


def check_room(mesh: bpy.types.Mesh) -> None:
    """UserError if no UV map can be added to a mesh."""
    if len(mesh.uv_layers) >= MOST_MAPS:
        raise UserError(f'"{mesh.name}" has {MOST_MAPS} UV maps, more cannot be added: remove one first')


def unwrap_parts(context: bpy.types.Context, mesh: bpy.types.Mesh, labels: IntArray, method: str) -> FloatArray:
    """(corners, 2) UVs of a mesh, cut along the borders of its (p,) parts and by one of `METHODS`; parts apart."""
    with _copy(context, mesh) as copy:
        part_of = labels[_ints(copy, POLYGON)]
        write_bools(copy.edges, "use_seam", read_bools(copy.edges, "use_seam") | border_edges(copy, part_of))
        corners = at_corners(copy, part_of)
        found, boxes = part_ids.unique_parts(part_of), []
        for part in found if method == SMART else []:
            _project(copy, part_of == part)
        everything = np.ones(len(part_of), dtype=bool)
        if method != SMART:
            with _edit(copy, everything):
                bpy.ops.uv.unwrap(method="ANGLE_BASED")
            # What is closed cannot be laid flat, and stays a point.
            _project(copy, _points(copy))
        with _edit(copy, everything):
            bpy.ops.uv.average_islands_scale()
        for part in found:
            with _edit(copy, part_of == part):
                bpy.ops.uv.pack_islands(scale=False, margin_method="ADD", margin=MARGIN)
            mine = _read(copy)[corners == part]
            low, high = mine.min(axis=0) - MARGIN, mine.max(axis=0) + MARGIN
            boxes.append([0.0, 0.0, *(high - low).tolist(), part, low])
        uvs = _read(copy)
        size = max(box_pack_2d(boxes))
        for x, y, _, _, part, low in boxes:
            uvs[corners == part] += (x, y) - low
        return _of_own_corners(mesh, _ints(copy, CORNER), uvs / size)


def project(context: bpy.types.Context, mesh: bpy.types.Mesh) -> FloatArray:
    """(corners, 2) UVs of a mesh by Smart UV Project."""
    with _copy(context, mesh) as copy:
        _project(copy, np.ones(len(copy.polygons), dtype=bool))
        return _of_own_corners(mesh, _ints(copy, CORNER), _read(copy))


@contextmanager
def _copy(context: bpy.types.Context, mesh: bpy.types.Mesh) -> Iterator[bpy.types.Mesh]:
    """A copy of a mesh with one UV map, on the active and only selected object, for as long as it lasts.

    Blender's operators on UVs take what is in edit mode, and nothing else. Vertices at one place are one, since
    importers split them where it is shaded flat; attributes tell which polygon and corner of the mesh each was.
    """
    layer, tools = context.view_layer, context.scene.tool_settings
    active, selected, synced = layer.objects.active, list(context.selected_objects), tools.use_uv_select_sync
    copy = mesh.copy()
    holder = bpy.data.objects.new(mesh.name, copy)
    try:
        holder.shape_key_clear()
        while copy.uv_layers:
            copy.uv_layers.remove(copy.uv_layers[-1])
        copy.uv_layers.new(name=NAME, do_init=False)
        for name, domain in ((POLYGON, "FACE"), (CORNER, "CORNER")):
            count = len(copy.polygons) if domain == "FACE" else len(copy.loops)
            new_attribute(copy, name, "INT", domain, np.arange(count))
        _weld(copy)
        context.scene.collection.objects.link(holder)
        for obj in selected:
            obj.select_set(False)
        layer.objects.active = holder
        holder.select_set(True)
        tools.use_uv_select_sync = False
        yield copy
    finally:
        bpy.data.objects.remove(holder)
        bpy.data.meshes.remove(copy)
        tools.use_uv_select_sync = synced
        layer.objects.active = active
        for obj in selected:
            obj.select_set(True)


def _project(mesh: bpy.types.Mesh, shown: BoolArray) -> None:
    """Smart UV Project of these (p,) polygons."""
    if shown.any():
        with _edit(mesh, shown):
            bpy.ops.uv.smart_project(angle_limit=SMART_ANGLE, island_margin=MARGIN)


def _points(mesh: bpy.types.Mesh) -> BoolArray:
    """(p,) whether all corners of a polygon are at one point of the UV map."""
    uvs, count = _read(mesh), polygon_sizes(mesh)
    first = np.cumsum(count) - count
    size = np.maximum.reduceat(uvs, first) - np.minimum.reduceat(uvs, first)
    return np.asarray(size.max(axis=1) == 0)


def _weld(mesh: bpy.types.Mesh) -> None:
    shape = bmesh.new()
    try:
        shape.from_mesh(mesh)
        bmesh.ops.remove_doubles(shape, verts=shape.verts[:], dist=SAME_PLACE)
        shape.to_mesh(mesh)
    finally:
        shape.free()


def _of_own_corners(mesh: bpy.types.Mesh, corner_of: IntArray, uvs: FloatArray) -> FloatArray:
    """(corners, 2) UVs of a mesh from those of its welded copy; a corner that is gone has those of the nearest left."""
    own = np.full((len(mesh.loops), 2), np.nan)
    own[corner_of] = uvs
    count = polygon_sizes(mesh)
    first = np.cumsum(count) - count
    polygon_of = np.repeat(np.arange(len(count)), count)
    for polygon in np.unique(polygon_of[np.isnan(own[:, 0])]).tolist():
        mine = np.arange(first[polygon], first[polygon] + count[polygon])
        there = mine[~np.isnan(own[mine, 0])]
        for corner in mine[np.isnan(own[mine, 0])].tolist():
            place = mesh.vertices[mesh.loops[corner].vertex_index].co
            away = [(mesh.vertices[mesh.loops[other].vertex_index].co - place).length for other in there.tolist()]
            own[corner] = own[there[int(np.argmin(away))]] if away else 0.0
    return own


@contextmanager
def _edit(mesh: bpy.types.Mesh, shown: BoolArray) -> Iterator[None]:
    """Edit mode of the active object, with these (p,) polygons of its mesh selected and the others hidden."""
    write_bools(mesh.polygons, "hide", ~shown)
    used = np.zeros(len(mesh.vertices), dtype=bool)
    used[read_ints(mesh.loops, "vertex_index")[at_corners(mesh, shown)]] = True
    write_bools(mesh.vertices, "hide", ~used)
    bpy.ops.object.mode_set(mode="EDIT")
    try:
        bpy.ops.mesh.select_all(action="SELECT")
        bpy.ops.uv.select_all(action="SELECT")
        yield
    finally:
        bpy.ops.object.mode_set(mode="OBJECT")


def _ints(mesh: bpy.types.Mesh, name: str) -> IntArray:
    values = read_attribute(mesh, name)
    assert values is not None
    return values.astype(np.int64)


def _read(mesh: bpy.types.Mesh) -> FloatArray:
    return read_floats(mesh.uv_layers[0].data, "uv", 2).astype(np.float64)
