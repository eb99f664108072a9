"""Writes labels to a mesh and takes them back. A note on the mesh says what, so that Clear removes just that."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ..core.mesh import FloatArray, IntArray
from . import parts
from .palette import linear
from .style import PLAIN, Style
from .vertex_groups import active_group, free_name, remove_groups, write_groups

FACES = "wks_segment"
VERTICES = "wks_segment_vertex"
COLORS = "wks_segment_color"
OWN_MATERIALS = "wks_segment_own_material"
"""Face attribute that keeps the material index of each face from before ours."""
NOTE = "wks_segment_note"
"""Custom property of a mesh: which attributes and vertex groups are ours, and what was active before."""
ATTRIBUTES = ("faces", "vertices", "colors", "own_materials", "model_labels")
"""Keys of the note under which names of attributes stand that new labels replace."""
LASTING = ("by_hand",)
"""Keys of the note under which names of attributes stand that outlast new labels, until Clear."""
COMPONENT = "wks_segment_component"
"""Custom property of our materials: the part that they show."""


def write_labels(
    mesh: bpy.types.Mesh, labels: IntArray, colors: bool = True, materials: bool = False,
    weights: Mapping[int, FloatArray] | None = None, style: Style = PLAIN,
) -> None:  # fmt: skip
    """Write (p,) parts of polygons to a mesh, in the place of what an earlier run wrote.

    Faces and vertices get an int attribute each; optionally a color attribute of the corners, and material slots
    behind the mesh's own, and a vertex group for each part whose (n,) weights are not all 0. Attributes and groups of
    the user that happen to have our names are left alone: ours get a number.
    """
    shown = None if weights is None else active_group(mesh)
    note = note_of(mesh)
    _take_back(mesh, note)
    # The note comes first and grows with what is written, so that Clear also mends a run that broke off.
    mesh[NOTE] = {key: note[key] for key in LASTING if key in note}
    write_ints(mesh, "faces", FACES, "FACE", labels)
    write_ints(mesh, "vertices", VERTICES, "POINT", _at_vertices(mesh, labels))
    if colors:
        active = mesh.color_attributes.active_color
        mesh[NOTE]["active_color"] = active.name if active is not None else ""
        _write_colors(mesh, labels, style)
    if materials:
        mesh[NOTE]["had_material_index"] = "material_index" in mesh.attributes
        mesh[NOTE]["first_slot"] = len(mesh.materials)
        before = np.empty(len(mesh.polygons), dtype=np.int32)
        mesh.polygons.foreach_get("material_index", before)
        write_ints(mesh, "own_materials", OWN_MATERIALS, "FACE", before)
        _write_materials(mesh, labels, style)
    if weights is not None:
        write_groups(mesh, weights, mesh[NOTE], style, shown)
    mesh.update()


def clear_labels(mesh: bpy.types.Mesh) -> bool:
    """Remove exactly what `write_labels` wrote and restore what was there; False if there was nothing."""
    if not has_labels(mesh):
        return False
    note = note_of(mesh)
    _take_back(mesh, note)
    for key in LASTING:
        attribute = mesh.attributes.get(note.get(key, ""))
        if attribute is not None:
            mesh.attributes.remove(attribute)
    del mesh[NOTE]
    mesh.update()
    return True


def _take_back(mesh: bpy.types.Mesh, note: dict[str, Any]) -> None:
    """Remove what `write_labels` wrote."""
    if "first_slot" in note:
        _restore_materials(mesh, note)
    for key in ATTRIBUTES:
        attribute = mesh.attributes.get(note.get(key, ""))
        if attribute is not None:
            mesh.attributes.remove(attribute)
    if note.get("had_material_index") is False and "material_index" in mesh.attributes:
        mesh.attributes.remove(mesh.attributes["material_index"])
    active = mesh.color_attributes.get(note.get("active_color", ""))
    if active is not None:
        mesh.color_attributes.active_color = active
    remove_groups(mesh, note)


def has_labels(mesh: bpy.types.Mesh) -> bool:
    """Whether a mesh carries anything that `write_labels` wrote."""
    return NOTE in mesh and hasattr(mesh[NOTE], "to_dict")


def note_of(mesh: bpy.types.Mesh) -> dict[str, Any]:
    """What is noted on a mesh, to read; empty if there is nothing of ours."""
    return mesh[NOTE].to_dict() if has_labels(mesh) else {}


def labels_on(mesh: bpy.types.Mesh) -> IntArray | None:
    """(p,) parts of a mesh's polygons, as they were written; None if there are none."""
    return read_ints(mesh, note_of(mesh).get("faces", ""))


def read_ints(mesh: bpy.types.Mesh, name: str) -> IntArray | None:
    """(p,) values of an int attribute of faces; None if there is none of that name."""
    attribute = mesh.attributes.get(name)
    if attribute is None or (attribute.data_type, attribute.domain) != ("INT", "FACE"):
        return None
    values = np.empty(len(attribute.data), dtype=np.int32)
    attribute.data.foreach_get("value", values)
    return values.astype(np.int64)


def own_material_index(mesh: bpy.types.Mesh) -> IntArray:
    """(p,) material slot of each polygon, without what `write_labels` wrote: the slots that Clear leaves."""
    note = note_of(mesh)
    now = np.empty(len(mesh.polygons), dtype=np.int32)
    mesh.polygons.foreach_get("material_index", now)
    ours = _our_slots(mesh, note)
    before = mesh.attributes.get(note.get("own_materials", ""))
    own = np.zeros_like(now)
    if before is not None:
        before.data.foreach_get("value", own)
    # Slots that the user added behind ours move up.
    moved = now - np.searchsorted(ours, now).astype(np.int32)
    return np.where(np.isin(now, ours), own, moved)


def write_ints(mesh: bpy.types.Mesh, key: str, name: str, domain: str, values: NDArray[np.integer[Any]]) -> None:
    """Add an int attribute and note the name that it got: a name that is taken gets a number."""
    attribute = mesh.attributes.new(free_name(mesh, name), "INT", domain)
    mesh[NOTE][key] = attribute.name
    attribute.data.foreach_set("value", np.asarray(values, dtype=np.int32))


def _at_vertices(mesh: bpy.types.Mesh, labels: IntArray) -> IntArray:
    """(n,) the label that most of the faces around each vertex have; 0 at a vertex without a face."""
    corner_vertex = np.empty(len(mesh.loops), dtype=np.int32)
    mesh.loops.foreach_get("vertex_index", corner_vertex)
    found, column = np.unique(labels, return_inverse=True)
    count = np.zeros((len(mesh.vertices), len(found)), dtype=np.int32)
    np.add.at(count, (corner_vertex, _at_corners(mesh, column.ravel())), 1)
    return np.where(count.any(axis=1), found[count.argmax(axis=1)], 0)


def _at_corners(mesh: bpy.types.Mesh, labels: IntArray) -> IntArray:
    corners = np.empty(len(mesh.polygons), dtype=np.int32)
    mesh.polygons.foreach_get("loop_total", corners)
    return np.repeat(labels, corners)


def _write_colors(mesh: bpy.types.Mesh, labels: IntArray, style: Style) -> None:
    # Corners, since colors of the FACE domain cannot be shown, and those of points would blend.
    attribute = mesh.color_attributes.new(free_name(mesh, COLORS), "BYTE_COLOR", "CORNER")
    mesh[NOTE]["colors"] = attribute.name
    colors = np.ones((len(mesh.loops), 4), dtype=np.float32)
    colors[:, :3] = style.colors_of(_at_corners(mesh, labels))
    attribute.data.foreach_set("color_srgb", colors.ravel())
    # What is rendered stays the user's: only what is shown in solid view changes.
    mesh.color_attributes.active_color = attribute


def _write_materials(mesh: bpy.types.Mesh, labels: IntArray, style: Style) -> None:
    slot = np.zeros(int(labels.max()) + 1, dtype=np.int32)
    for part in parts.among(labels):
        slot[part] = len(mesh.materials)
        mesh.materials.append(_material(part, style))
    mesh[NOTE]["last_slot"] = len(mesh.materials)
    mesh.polygons.foreach_set("material_index", slot[labels])


def _material(part: int, style: Style) -> bpy.types.Material:
    """The material of a part, one for all meshes."""
    for material in bpy.data.materials:
        if material.get(COMPONENT) == part and material.library is None:
            return material
    material = bpy.data.materials.new(style.name_of(part))
    material[COMPONENT] = part
    if bpy.app.version < (5, 0, 0):  # from then on always true, and touching it warns
        material.use_nodes = True
    recolor_material(material, part, style)
    return material


def recolor_material(material: bpy.types.Material, part: int, style: Style) -> None:
    """Give a material the colour of a part, in solid view and where its shader has a colour of its own."""
    color = (*linear(style.colors_of(np.array([part]))[0]).tolist(), 1.0)
    material.diffuse_color = color
    for node in material.node_tree.nodes if material.node_tree is not None else ():
        base = node.inputs.get("Base Color")
        if base is not None and not base.is_linked:
            base.default_value = color


def _restore_materials(mesh: bpy.types.Mesh, note: dict[str, Any]) -> None:
    """Take our slots out, and give faces that still use them their own material back."""
    restored = own_material_index(mesh)
    for index in reversed(_our_slots(mesh, note)):
        material = mesh.materials.pop(index=index)
        if material.users == 0:
            bpy.data.materials.remove(material)
    mesh.polygons.foreach_set("material_index", restored.astype(np.int32))


def _our_slots(mesh: bpy.types.Mesh, note: dict[str, Any]) -> list[int]:
    """Material slots that are ours, in order."""
    first = note.get("first_slot", 0)
    last = note.get("last_slot", first)
    return [i for i, m in enumerate(mesh.materials) if first <= i < last and m is not None and COMPONENT in m]
