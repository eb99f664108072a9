"""Separates the parts of an object into objects of their own, and removes those that are still as they were made."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from zlib import crc32

import bmesh
import bpy
import numpy as np
from mathutils import Matrix

from ...core.mesh.triangle_mesh import BoolArray, IntArray
from ..parts import part_ids
from ..parts.part_style import Style
from ..props.label_set import style_of
from ..scene.fingerprint import Label, fingerprint, is_made_as, label_of, made_as, users_of
from ..scene.multires import sculpted_surface
from ..scene.simulations import check_may_change
from .ledger import Ledger
from .origin import origin_of
from .own_property import OwnProperty
from .part_attributes import labels_on
from .part_materials import without_number
from .restore_point import on_failure, remove

_SEPARATED = OwnProperty("wks_segment_piece", "as")
"""Custom property of a separated object: the original ("of"), and how the object was made, see `made_as`."""
_ORIGINAL = OwnProperty("wks_segment_whole", "eye")
"""Custom property of the original object: whether it was hidden before."""


def separate(
    context: bpy.types.Context, obj: bpy.types.Object, labels: IntArray, style: Style
) -> list[bpy.types.Object]:
    """Make an object of each of the (p,) parts of an object, and hide the original.

    A separated object has the parent of the original, or else the original as its parent, and has its collections,
    modifiers, materials, vertex groups, shape keys and UV maps.
    """
    check_may_change(obj.data)
    separated = [_make(obj, labels, part, style) for part in part_ids.unique_parts(labels)]
    _enter(obj, separated)
    on_failure(lambda: _ORIGINAL.delete(obj))
    _ORIGINAL.put(obj, {"eye": obj.hide_get(), "render": obj.hide_render})
    for copy in separated:
        copy.select_set(True)
    obj.select_set(False)
    obj.hide_set(True)
    obj.hide_render = True
    context.view_layer.objects.active = separated[0]
    return separated


def original_of(obj: bpy.types.Object) -> bpy.types.Object | None:
    """The object that an object was separated from; the object itself if others were separated from it; else None."""
    if _ORIGINAL.of(obj) is not None:
        return obj
    made = _SEPARATED.of(obj)
    original = None if made is None else made.get("of")
    return original if isinstance(original, bpy.types.Object) else None


def unite(context: bpy.types.Context, original: bpy.types.Object) -> list[bpy.types.Object]:
    """Remove the objects that were separated from an object, and show it again.

    Objects that an artist has changed since stay, and are given back. So does all that uses them or their meshes.
    """
    changed = []
    for obj in separated_from(original):
        if is_as_made(obj):
            mesh = obj.data
            remove(obj)
            remove(mesh)
        else:
            changed.append(obj)
    for obj in changed:
        _let_go(_SEPARATED, obj)
    hidden = _ORIGINAL.of(original)
    if hidden is not None:
        eye, render = hidden["eye"], hidden["render"]
        _let_go(_ORIGINAL, original)
        original.hide_render = render
        if original.name in context.view_layer.objects:
            original.hide_set(eye)
    if original.visible_get(view_layer=context.view_layer):
        original.select_set(True)
        context.view_layer.objects.active = original
    return changed


def separated_from(original: bpy.types.Object) -> list[bpy.types.Object]:
    """The objects that were separated from an object."""
    return [obj for obj in bpy.data.objects if obj is not original and original_of(obj) is original]


def is_as_made(obj: bpy.types.Object) -> bool:
    """Whether a separated object, its mesh, and what uses them, are as they were made."""
    made = _SEPARATED.of(obj)
    if made.get("by") == bpy.app.version_string:
        return is_made_as(made, lambda label: _state(obj, made["of"], label))
    # Another version has other properties: then it must be as it would be made again.
    labels, original = labels_on(obj.data), made["of"]
    of_original = labels_on(original.data)
    if labels is None or of_original is None or len(np.unique(labels)) != 1 or labels[0] not in of_original:
        return False
    again = _make(original, of_original, int(labels[0]), Style())
    again.hide_render = _ORIGINAL.of(original)["render"] if _ORIGINAL.of(original) is not None else again.hide_render
    try:
        name = style_of(origin_of(original.data).labels).name_of(int(labels[0]))
        is_named = without_number(obj.name) == without_number(obj.data.name) == name
        return (
            is_named and _users(obj) == _users(again) and fingerprint(obj, obj.data) == fingerprint(again, again.data)
        )
    finally:
        mesh = again.data
        bpy.data.objects.remove(again)
        bpy.data.meshes.remove(mesh)


@contextmanager
def followed(objects: Iterable[bpy.types.Object]) -> Iterator[None]:
    """Let separated objects among some objects stay as made by us while we write to them."""
    separated = {obj: original for obj in objects if (original := original_of(obj)) not in (None, obj)}
    ours = [obj for obj in separated if is_as_made(obj)]
    yield
    for obj in ours:
        _enter(separated[obj], [obj])


def _make(obj: bpy.types.Object, labels: IntArray, part: int, style: Style) -> bpy.types.Object:
    """Make the object of a part."""
    mesh = _with_polygons(obj.data, labels == part)
    mesh.name = style.name_of(part)
    copy = obj.copy()
    copy.name, copy.data = style.name_of(part), mesh
    if obj.parent is None:
        _parent_to(copy, obj)
    for collection in obj.users_collection:
        collection.objects.link(copy)
    return copy


def _enter(original: bpy.types.Object, separated: list[bpy.types.Object]) -> None:
    """Keep how separated objects are made."""
    for obj in separated:
        made = made_as(lambda label, obj=obj: _state(obj, original, label))
        _SEPARATED.put(obj, {"of": original, **made})


def _let_go(own: OwnProperty, obj: bpy.types.Object) -> None:
    entries = own.of(obj).to_dict()
    on_failure(lambda: own.put(obj, entries))
    own.delete(obj)


def _state(obj: bpy.types.Object, original: bpy.types.Object | None, label: Label) -> str:
    """A hash of all that an artist may change of a separated object, and of its users; the original may be renamed."""
    users = users_of(obj, obj.data)

    def of_other(block: bpy.types.ID) -> str:
        return "original" if block == original else label(block)

    own = [label_of(block) for block in users]
    names = [*own, *(name for block in users for name in sorted(map(of_other, users[block])))]
    # A scene that has the object may use it once more, in a property of an add-on: that is in the counts only.
    parts = [*names, f"{obj.users} {obj.data.users}", f"{crc32(sculpted_surface(obj)):08x}"]
    return f"{crc32(chr(10).join(parts).encode()):08x}{fingerprint(obj, obj.data, label=of_other)}"


def _users(obj: bpy.types.Object) -> list[list[str]]:
    """Types and names, without numbers, of what uses an object and its mesh, apart from the object itself."""
    users = users_of(obj, obj.data)
    return [sorted(without_number(label_of(user)) for user in users[block] if user != obj) for block in users]


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
