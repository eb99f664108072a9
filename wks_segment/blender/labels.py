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
    clear_labels(mesh)
    # The note comes first and grows with what is written, so that Clear also mends a run that broke off.
    mesh[NOTE] = {}
    _write_ints(mesh, "faces", FACES, "FACE", labels)
    _write_ints(mesh, "vertices", VERTICES, "POINT", _at_vertices(mesh, labels))
    if colors:
        active = mesh.color_attributes.active_color
        mesh[NOTE]["active_color"] = active.name if active is not None else ""
        _write_colors(mesh, labels, style)
    if materials:
        mesh[NOTE]["had_material_index"] = "material_index" in mesh.attributes
        mesh[NOTE]["first_slot"] = len(mesh.materials)
        before = np.empty(len(mesh.polygons), dtype=np.int32)
        mesh.polygons.foreach_get("material_index", before)
        _write_ints(mesh, "own_materials", OWN_MATERIALS, "FACE", before)
        _write_materials(mesh, labels, style)
    if weights is not None:
        write_groups(mesh, weights, mesh[NOTE], style, shown)
    mesh.update()


def clear_labels(mesh: bpy.types.Mesh) -> bool:
    """Remove exactly what `write_labels` wrote and restore what was there; False if there was nothing."""
    if not has_labels(mesh):
        return False
    note = mesh[NOTE].to_dict()
    if "first_slot" in note:
        _restore_materials(mesh, note)
    for key in ("faces", "vertices", "colors", "own_materials"):
        attribute = mesh.attributes.get(note.get(key, ""))
        if attribute is not None:
            mesh.attributes.remove(attribute)
    if note.get("had_material_index") is False and "material_index" in mesh.attributes:
        mesh.attributes.remove(mesh.attributes["material_index"])
    # In 5.2 their names outlive the attribute that was active.
    for kind in ("active_color_name", "default_color_name"):
        if "colors" in note and getattr(mesh.attributes, kind) == note["colors"]:
            setattr(mesh.attributes, kind, "")
    active = mesh.color_attributes.get(note.get("active_color", ""))
    if active is not None:
        mesh.color_attributes.active_color = active
    remove_groups(mesh, note)
    del mesh[NOTE]
    mesh.update()
    return True


def has_labels(mesh: bpy.types.Mesh) -> bool:
    """Whether a mesh carries anything that `write_labels` wrote."""
    return NOTE in mesh and hasattr(mesh[NOTE], "to_dict")


def own_material_index(mesh: bpy.types.Mesh) -> IntArray:
    """(p,) material slot of each polygon, without what `write_labels` wrote: the slots that Clear leaves."""
    note = mesh[NOTE].to_dict() if has_labels(mesh) else {}
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


def _write_ints(mesh: bpy.types.Mesh, key: str, name: str, domain: str, values: NDArray[np.integer[Any]]) -> None:
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
    color = (*linear(style.colors_of(np.array([part]))[0]).tolist(), 1.0)
    material.diffuse_color = color
    if bpy.app.version < (5, 0, 0):  # from then on always true, and touching it warns
        material.use_nodes = True
    material.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = color
    return material


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
