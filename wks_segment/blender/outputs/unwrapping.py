"""Unwraps a mesh along the borders of its parts, and where the parts must be cut open to lie flat."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from math import radians

import bmesh
import bpy
import numpy as np
from mathutils import Matrix

from ...core.mesh.triangle_mesh import BoolArray, FloatArray, IntArray
from ...core.message import Message
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
from ..scene.topology import at_corners, border_edges, polygon_mesh, polygon_sizes
from .uv_maps import UV_MAP_NAME

ISLAND_MARGIN = 5 / 1024
"""Space between two UV islands as a share of the image's width: four pixels of 1024, and one since Blender's packing is
not exact."""
SMART_ANGLE = radians(66)
"""Angle limit of Smart UV Project: Blender's own default."""
WELD_DISTANCE = 1e-6
"""Vertices that are nearer to each other than this are one, as importers split them at the same place."""
MOST_SPLITS = 10
"""Most rounds in which charts that cannot be laid flat are split in two. Of 22 characters 21 need at most six."""
OVERLAP_PIXELS = 1024
"""A chart that lies on itself is split if it does so at a pixel of an image of this width."""
BACK_OF_BODY = np.array([0.0, 1.0, 0.0])
"""Characters look along -Y in Blender, as its front view shows them."""
POLYGON_ATTRIBUTE, CORNER_ATTRIBUTE = "wks_segment_polygon", "wks_segment_corner"
"""Attributes of the copy that is unwrapped: index of each polygon and corner in the mesh."""
ALONG_SEAMS, SMART_PROJECT = "SEAMS", "SMART"
UNWRAP_METHODS = (
    (ALONG_SEAMS, "Along Seams", "Cut at your seams, and where needed along the inner side of limbs"),
    (SMART_PROJECT, "Smart Project", "Cut where the surface turns, as Smart UV Project does"),
)
"""Where islands are cut in addition to the borders of segments, as items of an enum property."""


def unwrap_parts(context: bpy.types.Context, obj: bpy.types.Object, labels: IntArray, method: str) -> FloatArray:
    """(corners, 2) UVs of an object's mesh, cut along the borders of its (p,) parts and by one of `UNWRAP_METHODS`."""
    mesh = obj.data
    with _copy_to_unwrap(context, mesh, obj.matrix_world) as copy:
        labels = labels[_read_index(copy, POLYGON_ATTRIBUTE)]
        if method == SMART_PROJECT:
            for part in part_ids.unique_parts(labels):
                _smart_project(copy, labels == part)
        else:
            _unwrap(copy, read_bools(copy.edges, "use_seam") | border_edges(copy, labels))
        _pack(copy)
        return _uvs_of_original(mesh, _read_index(copy, CORNER_ATTRIBUTE), _read_uvs(copy))


def unwrapped_message(obj: bpy.types.Object) -> Message:
    """What is told of an object that was unwrapped: figures of its active UV map."""
    from ...core.uv.quality import UvQuality

    uvs = read_floats(obj.data.uv_layers.active.data, "uv", 2).astype(np.float64)
    quality = UvQuality.of(polygon_mesh(obj.data), uvs)
    return Message(
        'Unwrapped "{name}": {even:.1%} of the faces have the same density within 4 ×, and are stretched by '
        "{stretch:.2f} on average",
        name=obj.name, even=quality.even, stretch=quality.stretch,
    )  # fmt: skip


def _unwrap(copy: bpy.types.Mesh, closed: BoolArray) -> None:
    """Unwrap the copy, given the (e,) edges where it is cut in any case.

    A chart that lies on itself or is uneven is split in two, and its halves are unwrapped again. What is left after
    some rounds, such as teeth of a few faces, is projected.
    """
    from ...core.uv.charts import Charts
    from ...core.uv.cuts import HiddenSide, cut_open, split
    from ...core.uv.quality import faulty_pairs

    whole = polygon_mesh(copy)
    hidden_side = HiddenSide(whole.middle, BACK_OF_BODY)
    seams, shown = closed.copy(), np.ones(len(whole.sizes), dtype=bool)
    for _ in range(1 + MOST_SPLITS):
        mesh = whole.part(shown)
        seams[mesh.corner_edge] = (closed | cut_open(mesh, closed, hidden_side))[mesh.corner_edge]
        write_bools(copy.edges, "use_seam", seams)
        with _editing(copy, shown):
            bpy.ops.uv.unwrap(method="ANGLE_BASED", fill_holes=True, correct_aspect=False)
        chart = Charts(mesh, closed).polygon_chart
        pairs = faulty_pairs(mesh, _read_uvs(copy)[at_corners(copy, shown)], chart, OVERLAP_PIXELS)
        if not len(pairs):
            return
        closed = closed | split(mesh, closed, pairs)
        shown[shown] = np.isin(chart, chart[pairs[:, 0]])
    _smart_project(copy, shown)


def _smart_project(copy: bpy.types.Mesh, shown: BoolArray) -> None:
    """Smart UV Project of these (p,) polygons."""
    with _editing(copy, shown):
        bpy.ops.uv.smart_project(angle_limit=SMART_ANGLE)


def _pack(copy: bpy.types.Mesh) -> None:
    """Scale the islands to the same density, and pack them."""
    with _editing(copy):
        bpy.ops.uv.average_islands_scale()
        bpy.ops.uv.pack_islands(margin_method="FRACTION", margin=ISLAND_MARGIN / 2, shape_method="AABB")
        # Packed by their shapes, which is slow with an exact margin, islands grow a little, and the margin with them.
        bpy.ops.uv.pack_islands(margin_method="ADD", margin=ISLAND_MARGIN / 2)


@contextmanager
def _copy_to_unwrap(context: bpy.types.Context, mesh: bpy.types.Mesh, matrix: Matrix) -> Iterator[bpy.types.Mesh]:
    """A temporary copy of a mesh in world space with one UV map, on the active and only selected object.

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
        copy.materials.clear()  # islands are stretched to the width and height of a material's image
        _weld(copy)
        if matrix.determinant():
            copy.transform(matrix)
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
def _editing(mesh: bpy.types.Mesh, shown: BoolArray | None = None) -> Iterator[None]:
    """Edit Mode of the active object, with these (p,) polygons of its mesh, or all, selected and the others hidden."""
    if shown is None:
        shown = np.ones(len(mesh.polygons), dtype=bool)
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
