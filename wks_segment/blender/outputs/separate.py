"""Separates parts into objects of their own, and takes those back that are still as they were made."""

from __future__ import annotations

from typing import Any
from zlib import crc32

import bmesh
import bpy
import numpy as np
from mathutils import Matrix
from numpy.typing import NDArray

from ...core.mesh.triangle_mesh import BoolArray, IntArray
from ..parts import part_ids
from ..parts.part_style import Style
from ..scene.attributes import read_floats, read_ints
from .ledger import NOTE
from .vertex_groups import group_weights

PIECE = "wks_segment_piece"
"""Custom property of a piece: the object that it is of, and what it was like."""
WHOLE = "wks_segment_whole"
"""Custom property of the original: whether it was hidden before."""


def separate(
    context: bpy.types.Context, obj: bpy.types.Object, labels: IntArray, style: Style
) -> list[bpy.types.Object]:
    """Make an object of each of the (p,) parts of an object, and hide it.

    A piece hangs from what the original hangs from, or else from the original, and has its collections, modifiers,
    materials, vertex groups, shape keys and UV maps.
    """
    pieces = []
    for part in part_ids.unique_parts(labels):
        mesh = _only(obj.data, labels == part)
        mesh.name = style.name_of(part)
        piece = obj.copy()
        piece.name, piece.data = style.name_of(part), mesh
        if obj.parent is None:
            _hang_from(piece, obj)
        for collection in obj.users_collection:
            collection.objects.link(piece)
        pieces.append(piece)
    for piece in pieces:
        piece[PIECE] = {"of": obj, "as": _print(piece)}
    obj[WHOLE] = {"eye": obj.hide_get(), "render": obj.hide_render}
    for piece in pieces:
        piece.select_set(True)
    obj.select_set(False)
    obj.hide_set(True)
    obj.hide_render = True
    context.view_layer.objects.active = pieces[0]
    return pieces


def whole_of(obj: bpy.types.Object) -> bpy.types.Object | None:
    """The object that one is a piece of; itself if it has pieces; else None."""
    if WHOLE in obj:
        return obj
    return obj[PIECE].get("of") if PIECE in obj and hasattr(obj[PIECE], "to_dict") else None


def unite(context: bpy.types.Context, whole: bpy.types.Object) -> int:
    """Remove the pieces of an object and show it again; how many pieces stay, as an artist has changed them since."""
    kept = 0
    for piece in [obj for obj in bpy.data.objects if obj is not whole and whole_of(obj) is whole]:
        changed = piece[PIECE]["as"] != _print(piece)
        if changed:
            del piece[PIECE]
            kept += 1
        else:
            mesh = piece.data
            bpy.data.objects.remove(piece)
            bpy.data.meshes.remove(mesh)
    before = whole[WHOLE].to_dict()
    del whole[WHOLE]
    whole.hide_render = before["render"]
    if whole.name in context.view_layer.objects:
        whole.hide_set(before["eye"])
    if whole.visible_get(view_layer=context.view_layer):
        whole.select_set(True)
        context.view_layer.objects.active = whole
    return kept


def _only(mesh: bpy.types.Mesh, kept: BoolArray) -> bpy.types.Mesh:
    """A copy of a mesh with some of its (p,) polygons, and nothing loose."""
    copy = mesh.copy()
    copy[NOTE].pop("id_map", None)  # the image is the original's
    shape = bmesh.new()
    try:
        shape.from_mesh(copy)
        shape.faces.ensure_lookup_table()
        gone = [shape.faces[i] for i in np.flatnonzero(~kept).tolist()]
        bmesh.ops.delete(shape, geom=gone, context="FACES")
        loose = [vertex for vertex in shape.verts if not vertex.link_faces]
        bmesh.ops.delete(shape, geom=loose, context="VERTS")
        shape.to_mesh(copy)
    finally:
        shape.free()
    return copy


def _hang_from(piece: bpy.types.Object, obj: bpy.types.Object) -> None:
    """Parent a copy of an object to it, at the same place: what moves the one moves the other."""
    piece.animation_data_clear()
    piece.constraints.clear()
    piece.parent = obj
    piece.matrix_parent_inverse = Matrix()
    piece.delta_location, piece.delta_rotation_euler, piece.delta_scale = (0, 0, 0), (0, 0, 0), (1, 1, 1)
    piece.delta_rotation_quaternion = (1, 0, 0, 0)
    piece.matrix_basis = Matrix()


def _print(piece: bpy.types.Object) -> str:
    """A number that changes when an artist works on a piece: on its names, place, shape, UVs, colors or weights."""
    mesh = piece.data
    told = [piece.name, *(slot.name for slot in piece.material_slots), *(modifier.name for modifier in piece.modifiers)]
    if piece.animation_data is None:
        told += [f"{value:.9g}" for row in piece.matrix_basis for value in row]
    shapes = [block.data for block in mesh.shape_keys.key_blocks] if mesh.shape_keys else [mesh.vertices]
    values: list[NDArray[Any]] = [
        np.frombuffer("\n".join(told).encode(), dtype=np.uint8),
        read_ints(mesh.loops, "vertex_index").astype(np.int32),
        *(read_floats(shape, "co", 3) for shape in shapes),
        *(read_floats(layer.data, "uv", 2) for layer in mesh.uv_layers),
        *(read_floats(layer.data, "color", 4) for layer in mesh.color_attributes),
        *group_weights(mesh).values(),
    ]
    total = 0
    for array in values:
        total = crc32(array.tobytes(), total)
    return f"{total:08x}"
