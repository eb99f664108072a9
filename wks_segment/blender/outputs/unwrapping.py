"""Unwraps a mesh along the borders of its parts, and packs the UV islands part by part."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from math import radians

import bmesh
import bpy
import numpy as np
from mathutils.geometry import box_pack_2d

from ...core.mesh.triangle_mesh import BoolArray, FloatArray, IntArray
from ..parts import part_ids
from ..scene.attributes import (
    new_attribute,
    read_attribute,
    read_bools,
    read_floats,
    read_ints,
    write_bools,
)
from ..scene.simulations import check_may_change
from ..scene.topology import at_corners, border_edges, polygon_sizes
from .uv_maps import UV_MAP_NAME

ISLAND_MARGIN = 0.004
"""Space between two UV islands as a share of the image's width: eight pixels of 2048."""
SMART_ANGLE = radians(66)
"""Angle limit of Smart UV Project: Blender's own default."""
WELD_DISTANCE = 1e-6
"""Vertices that are nearer to each other than this are one, as importers split them at the same place."""
POLYGON_ATTRIBUTE, CORNER_ATTRIBUTE = "wks_segment_polygon", "wks_segment_corner"
"""Attributes of the copy that is unwrapped: index of each polygon and corner in the mesh."""
ALONG_SEAMS, SMART_PROJECT = "SEAMS", "SMART"
UNWRAP_METHODS = (
    (ALONG_SEAMS, "Along Seams", "Cut only at seams. A segment that is closed, or a long tube, needs some"),
    (SMART_PROJECT, "Smart Project", "Cut where the surface turns, as Smart UV Project does"),
)
"""Where islands are cut in addition to the borders of segments, as items of an enum property."""


def unwrap_parts(context: bpy.types.Context, mesh: bpy.types.Mesh, labels: IntArray, method: str) -> FloatArray:
    """(corners, 2) UVs of a mesh, cut along the borders of its (p,) parts and by one of `UNWRAP_METHODS`.

    Each part has a box of its own in the image.
    """
    with _copy_to_unwrap(context, mesh) as copy:
        labels = labels[_read_index(copy, POLYGON_ATTRIBUTE)]
        write_bools(copy.edges, "use_seam", read_bools(copy.edges, "use_seam") | border_edges(copy, labels))
        _unwrap(copy, labels, method)
        return _uvs_of_original(mesh, _read_index(copy, CORNER_ATTRIBUTE), _pack_by_part(copy, labels))


def project(context: bpy.types.Context, mesh: bpy.types.Mesh) -> FloatArray:
    """(corners, 2) UVs of a mesh by Smart UV Project."""
    with _copy_to_unwrap(context, mesh) as copy:
        _smart_project(copy, np.ones(len(copy.polygons), dtype=bool))
        return _uvs_of_original(mesh, _read_index(copy, CORNER_ATTRIBUTE), _read_uvs(copy))


def _unwrap(copy: bpy.types.Mesh, labels: IntArray, method: str) -> None:
    """Unwrap the copy, given its (p,) parts, and scale its islands to the same density."""
    all_polygons = np.ones(len(labels), dtype=bool)
    if method == SMART_PROJECT:
        for part in part_ids.unique_parts(labels):
            _smart_project(copy, labels == part)
    else:
        with _editing(copy, all_polygons):
            bpy.ops.uv.unwrap(method="ANGLE_BASED")
        # A closed surface cannot be laid flat: unwrap leaves it as a point.
        _smart_project(copy, _unwrapped_to_points(copy))
    with _editing(copy, all_polygons):
        bpy.ops.uv.average_islands_scale()


def _pack_by_part(copy: bpy.types.Mesh, labels: IntArray) -> FloatArray:
    """(corners, 2) UVs of the copy, where the islands of each of the (p,) parts lie together in a box."""
    label_of_corner = at_corners(copy, labels)
    boxes = []
    for part in part_ids.unique_parts(labels):
        with _editing(copy, labels == part):
            bpy.ops.uv.pack_islands(scale=False, margin_method="ADD", margin=ISLAND_MARGIN)
        uvs_of_part = _read_uvs(copy)[label_of_corner == part]
        low, high = uvs_of_part.min(axis=0) - ISLAND_MARGIN, uvs_of_part.max(axis=0) + ISLAND_MARGIN
        boxes.append([0.0, 0.0, *(high - low).tolist(), part, low])
    uvs = _read_uvs(copy)
    size = max(box_pack_2d(boxes))
    for x, y, _, _, part, low in boxes:
        uvs[label_of_corner == part] += (x, y) - low
    return uvs / size


@contextmanager
def _copy_to_unwrap(context: bpy.types.Context, mesh: bpy.types.Mesh) -> Iterator[bpy.types.Mesh]:
    """A temporary copy of a mesh with one UV map, on the active and only selected object.

    Blender's UV operators work on what is in Edit Mode. Vertices at the same place are merged in the copy, since
    importers split them where shading is flat; attributes keep the index of each polygon and corner in the mesh.
    """
    check_may_change(mesh)  # Blender 4.2 throws frames away as soon as the mesh is copied
    layer, tools = context.view_layer, context.scene.tool_settings
    active, selected, synced = layer.objects.active, list(context.selected_objects), tools.use_uv_select_sync
    copy = mesh.copy()
    owner = bpy.data.objects.new(mesh.name, copy)
    try:
        owner.shape_key_clear()
        while copy.uv_layers:
            copy.uv_layers.remove(copy.uv_layers[-1])
        copy.uv_layers.new(name=UV_MAP_NAME, do_init=False)
        new_attribute(copy, POLYGON_ATTRIBUTE, "INT", "FACE", np.arange(len(copy.polygons)))
        new_attribute(copy, CORNER_ATTRIBUTE, "INT", "CORNER", np.arange(len(copy.loops)))
        _weld(copy)
        context.scene.collection.objects.link(owner)
        for obj in selected:
            obj.select_set(False)
        layer.objects.active = owner
        owner.select_set(True)
        tools.use_uv_select_sync = False
        yield copy
    finally:
        bpy.data.objects.remove(owner)
        bpy.data.meshes.remove(copy)
        tools.use_uv_select_sync = synced
        layer.objects.active = active
        for obj in selected:
            obj.select_set(True)


def _smart_project(mesh: bpy.types.Mesh, shown: BoolArray) -> None:
    """Smart UV Project of these (p,) polygons."""
    if shown.any():
        with _editing(mesh, shown):
            bpy.ops.uv.smart_project(angle_limit=SMART_ANGLE, island_margin=ISLAND_MARGIN)


def _unwrapped_to_points(mesh: bpy.types.Mesh) -> BoolArray:
    """(p,) whether all corners of a polygon are at one point of the UV map."""
    uvs, sizes = _read_uvs(mesh), polygon_sizes(mesh)
    starts = np.cumsum(sizes) - sizes
    extent = np.maximum.reduceat(uvs, starts) - np.minimum.reduceat(uvs, starts)
    return np.asarray(extent.max(axis=1) == 0)


def _weld(mesh: bpy.types.Mesh) -> None:
    """Merge vertices at the same place."""
    edited = bmesh.new()
    try:
        edited.from_mesh(mesh)
        bmesh.ops.remove_doubles(edited, verts=edited.verts[:], dist=WELD_DISTANCE)
        edited.to_mesh(mesh)
    finally:
        edited.free()


def _uvs_of_original(mesh: bpy.types.Mesh, corner_of: IntArray, uvs: FloatArray) -> FloatArray:
    """(corners, 2) UVs of a mesh, given the UVs of its welded copy and the corner of the mesh that each is of.

    A corner that was merged away has the UVs of the nearest corner that is left of its polygon.
    """
    result = np.full((len(mesh.loops), 2), np.nan)
    result[corner_of] = uvs
    sizes = polygon_sizes(mesh)
    starts = np.cumsum(sizes) - sizes
    polygon_of = np.repeat(np.arange(len(sizes)), sizes)
    for polygon in np.unique(polygon_of[np.isnan(result[:, 0])]).tolist():
        corners = np.arange(starts[polygon], starts[polygon] + sizes[polygon])
        is_gone = np.isnan(result[corners, 0])
        left = corners[~is_gone]
        for corner in corners[is_gone].tolist():
            place = mesh.vertices[mesh.loops[corner].vertex_index].co
            distances = [(mesh.vertices[mesh.loops[other].vertex_index].co - place).length for other in left.tolist()]
            result[corner] = result[left[int(np.argmin(distances))]] if distances else 0.0
    return result


@contextmanager
def _editing(mesh: bpy.types.Mesh, shown: BoolArray) -> Iterator[None]:
    """Edit Mode of the active object, with these (p,) polygons of its mesh selected and the others hidden."""
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


def _read_index(mesh: bpy.types.Mesh, name: str) -> IntArray:
    values = read_attribute(mesh, name)
    assert values is not None
    return values.astype(np.int64)


def _read_uvs(mesh: bpy.types.Mesh) -> FloatArray:
    return read_floats(mesh.uv_layers[0].data, "uv", 2).astype(np.float64)
