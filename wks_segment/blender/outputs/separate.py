"""Separates the parts of an object into objects of their own, and removes those that are still as they were made."""

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
from ..scene.vertex_group_access import group_weights
from .ledger import Ledger

SEPARATED_PROPERTY = "wks_segment_piece"
"""Custom property of a separated object: the original object ("of") and a checksum of the object as made ("as")."""
ORIGINAL_PROPERTY = "wks_segment_whole"
"""Custom property of the original object: whether it was hidden before."""


def separate(
    context: bpy.types.Context, obj: bpy.types.Object, labels: IntArray, style: Style
) -> list[bpy.types.Object]:
    """Make an object of each of the (p,) parts of an object, and hide the original.

    A separated object has the parent of the original, or else the original as its parent, and has its collections,
    modifiers, materials, vertex groups, shape keys and UV maps.
    """
    separated = []
    for part in part_ids.unique_parts(labels):
        mesh = _with_polygons(obj.data, labels == part)
        mesh.name = style.name_of(part)
        copy = obj.copy()
        copy.name, copy.data = style.name_of(part), mesh
        if obj.parent is None:
            _parent_to(copy, obj)
        for collection in obj.users_collection:
            collection.objects.link(copy)
        separated.append(copy)
    for copy in separated:
        copy[SEPARATED_PROPERTY] = {"of": obj, "as": _checksum(copy)}
    obj[ORIGINAL_PROPERTY] = {"eye": obj.hide_get(), "render": obj.hide_render}
    for copy in separated:
        copy.select_set(True)
    obj.select_set(False)
    obj.hide_set(True)
    obj.hide_render = True
    context.view_layer.objects.active = separated[0]
    return separated


def original_of(obj: bpy.types.Object) -> bpy.types.Object | None:
    """The object that an object was separated from; the object itself if others were separated from it; else None."""
    if ORIGINAL_PROPERTY in obj:
        return obj
    is_ours = SEPARATED_PROPERTY in obj and hasattr(obj[SEPARATED_PROPERTY], "to_dict")
    return obj[SEPARATED_PROPERTY].get("of") if is_ours else None


def unite(context: bpy.types.Context, original: bpy.types.Object) -> int:
    """Remove the objects that were separated from an object, and show it again.

    Objects that an artist has changed since stay; gives their number.
    """
    n_kept = 0
    for obj in [obj for obj in bpy.data.objects if obj is not original and original_of(obj) is original]:
        if obj[SEPARATED_PROPERTY]["as"] != _checksum(obj):
            del obj[SEPARATED_PROPERTY]
            n_kept += 1
        else:
            mesh = obj.data
            bpy.data.objects.remove(obj)
            bpy.data.meshes.remove(mesh)
    hidden = original[ORIGINAL_PROPERTY].to_dict()
    del original[ORIGINAL_PROPERTY]
    original.hide_render = hidden["render"]
    if original.name in context.view_layer.objects:
        original.hide_set(hidden["eye"])
    if original.visible_get(view_layer=context.view_layer):
        original.select_set(True)
        context.view_layer.objects.active = original
    return n_kept


def _with_polygons(mesh: bpy.types.Mesh, kept: BoolArray) -> bpy.types.Mesh:
    """A copy of a mesh with some of its (p,) polygons, and no loose vertices."""
    copy = mesh.copy()
    Ledger(copy).remove("id_map")  # the image is the original's
    edited = bmesh.new()
    try:
        edited.from_mesh(copy)
        edited.faces.ensure_lookup_table()
        removed = [edited.faces[i] for i in np.flatnonzero(~kept).tolist()]
        bmesh.ops.delete(edited, geom=removed, context="FACES")
        loose = [vertex for vertex in edited.verts if not vertex.link_faces]
        bmesh.ops.delete(edited, geom=loose, context="VERTS")
        edited.to_mesh(copy)
    finally:
        edited.free()
    return copy


def _parent_to(copy: bpy.types.Object, obj: bpy.types.Object) -> None:
    """Make an object the parent of its copy, which stays at its place: what moves the one moves the other."""
    copy.animation_data_clear()
    copy.constraints.clear()
    copy.parent = obj
    copy.matrix_parent_inverse = Matrix()
    copy.delta_location, copy.delta_rotation_euler, copy.delta_scale = (0, 0, 0), (0, 0, 0), (1, 1, 1)
    copy.delta_rotation_quaternion = (1, 0, 0, 0)
    copy.matrix_basis = Matrix()


def _checksum(obj: bpy.types.Object) -> str:
    """A number that changes with what an artist may change of an object: names, place, shape, UVs, colors, weights."""
    mesh = obj.data
    texts = [obj.name, *(slot.name for slot in obj.material_slots), *(modifier.name for modifier in obj.modifiers)]
    if obj.animation_data is None:
        texts += [f"{value:.9g}" for row in obj.matrix_basis for value in row]
    shapes = [block.data for block in mesh.shape_keys.key_blocks] if mesh.shape_keys else [mesh.vertices]
    arrays: list[NDArray[Any]] = [
        np.frombuffer("\n".join(texts).encode(), dtype=np.uint8),
        read_ints(mesh.loops, "vertex_index").astype(np.int32),
        *(read_floats(shape, "co", 3) for shape in shapes),
        *(read_floats(layer.data, "uv", 2) for layer in mesh.uv_layers),
        *(read_floats(layer.data, "color", 4) for layer in mesh.color_attributes),
        *group_weights(mesh).values(),
    ]
    checksum = 0
    for array in arrays:
        checksum = crc32(array.tobytes(), checksum)
    return f"{checksum:08x}"
