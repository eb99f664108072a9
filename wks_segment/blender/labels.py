"""Writes labels to a mesh and takes them back. A note on the mesh says what, so that Clear removes just that."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ..core.mesh import IntArray
from .palette import palette

FACES = "wks_segment"
VERTICES = "wks_segment_vertex"
COLORS = "wks_segment_color"
OWN_MATERIALS = "wks_segment_own_material"
"""Face attribute that keeps the material index of each face from before ours."""
NOTE = "wks_segment"
"""Custom property of a mesh: which attributes are ours, and what was active before."""
COMPONENT = "wks_segment_component"
"""Custom property of our materials: the component that they show."""


def write_labels(mesh: bpy.types.Mesh, labels: IntArray, colors: bool = True, materials: bool = False) -> None:
    """Write (p,) components of polygons to a mesh, in the place of what an earlier run wrote.

    Faces and vertices get an int attribute each; optionally a color attribute of the corners, and material slots
    behind the mesh's own. Attributes of the user that happen to have our names are left alone: ours get a number.
    """
    clear_labels(mesh)
    note: dict[str, str | int] = {
        "faces": _write_ints(mesh, FACES, "FACE", labels),
        "vertices": _write_ints(mesh, VERTICES, "POINT", _at_vertices(mesh, labels)),
    }
    if colors:
        active = mesh.color_attributes.active_color
        note["active_color"] = active.name if active is not None else ""
        note["render_color"] = mesh.color_attributes.render_color_index
        note["colors"] = _write_colors(mesh, labels)
    if materials:
        before = np.empty(len(mesh.polygons), dtype=np.int32)
        mesh.polygons.foreach_get("material_index", before)
        note["own_materials"] = _write_ints(mesh, OWN_MATERIALS, "FACE", before)
        _write_materials(mesh, labels)
    mesh[NOTE] = note
    mesh.update()


def clear_labels(mesh: bpy.types.Mesh) -> bool:
    """Remove exactly what `write_labels` wrote and restore what was there; False if there was nothing."""
    if NOTE not in mesh:
        return False
    note = mesh[NOTE].to_dict()
    if "own_materials" in note:
        _restore_materials(mesh, note["own_materials"])
    for key in ("faces", "vertices", "colors", "own_materials"):
        attribute = mesh.attributes.get(note.get(key, ""))
        if attribute is not None:
            mesh.attributes.remove(attribute)
    if "colors" in note:
        _restore_active_color(mesh, note["active_color"], note["render_color"])
    del mesh[NOTE]
    mesh.update()
    return True


def read_labels(mesh: bpy.types.Mesh) -> IntArray | None:
    """(p,) components of the polygons that were written to a mesh; None if there are none."""
    attribute = mesh.attributes.get(mesh[NOTE]["faces"]) if NOTE in mesh else None
    if attribute is None:
        return None
    labels = np.empty(len(mesh.polygons), dtype=np.int32)
    attribute.data.foreach_get("value", labels)
    return labels.astype(np.int64)


def _write_ints(mesh: bpy.types.Mesh, name: str, domain: str, values: NDArray[np.integer[Any]]) -> str:
    """Add an int attribute; the name that it got, since a name that is taken gets a number."""
    attribute = mesh.attributes.new(name, "INT", domain)
    attribute.data.foreach_set("value", np.asarray(values, dtype=np.int32))
    return attribute.name


def _at_vertices(mesh: bpy.types.Mesh, labels: IntArray) -> IntArray:
    """(n,) the label that most of the faces around each vertex have; 0 at a vertex without a face."""
    corner_vertex = np.empty(len(mesh.loops), dtype=np.int32)
    mesh.loops.foreach_get("vertex_index", corner_vertex)
    count = np.zeros((len(mesh.vertices), int(labels.max()) + 1), dtype=np.int32)
    np.add.at(count, (corner_vertex, _at_corners(mesh, labels)), 1)
    return count.argmax(axis=1)


def _at_corners(mesh: bpy.types.Mesh, labels: IntArray) -> IntArray:
    corners = np.empty(len(mesh.polygons), dtype=np.int32)
    mesh.polygons.foreach_get("loop_total", corners)
    return np.repeat(labels, corners)


def _write_colors(mesh: bpy.types.Mesh, labels: IntArray) -> str:
    # Corners, since colors of the FACE domain cannot be shown, and those of points would blend.
    attribute = mesh.color_attributes.new(COLORS, "BYTE_COLOR", "CORNER")
    colors = np.ones((len(mesh.loops), 4), dtype=np.float32)
    colors[:, :3] = palette()[_at_corners(mesh, labels)]
    attribute.data.foreach_set("color_srgb", colors.ravel())
    mesh.color_attributes.active_color = attribute
    mesh.color_attributes.render_color_index = mesh.color_attributes.find(attribute.name)
    return attribute.name


def _restore_active_color(mesh: bpy.types.Mesh, active: str, render_index: int) -> None:
    attribute = mesh.color_attributes.get(active)
    if attribute is not None:
        mesh.color_attributes.active_color = attribute
    if 0 <= render_index < len(mesh.color_attributes):
        mesh.color_attributes.render_color_index = render_index


def _write_materials(mesh: bpy.types.Mesh, labels: IntArray) -> None:
    slot = np.zeros(int(labels.max()) + 1, dtype=np.int32)
    for component in np.unique(labels).tolist():
        slot[component] = len(mesh.materials)
        mesh.materials.append(_material(component))
    mesh.polygons.foreach_set("material_index", slot[labels])


def _material(component: int) -> bpy.types.Material:
    """The material of a component, one for all meshes."""
    for material in bpy.data.materials:
        if material.get(COMPONENT) == component and material.library is None:
            return material
    material = bpy.data.materials.new(f"Segment {component + 1}")
    material[COMPONENT] = component
    srgb = palette()[component]
    linear = np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
    color = (*linear.tolist(), 1.0)
    material.diffuse_color = color
    if bpy.app.version < (5, 0, 0):  # from then on always true, and touching it warns
        material.use_nodes = True
    material.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = color
    return material


def _restore_materials(mesh: bpy.types.Mesh, own: str) -> None:
    attribute = mesh.attributes.get(own)
    if attribute is not None:
        before = np.empty(len(mesh.polygons), dtype=np.int32)
        attribute.data.foreach_get("value", before)
        mesh.polygons.foreach_set("material_index", before)
    for index in reversed(range(len(mesh.materials))):
        material = mesh.materials[index]
        if material is not None and COMPONENT in material:
            mesh.materials.pop(index=index)
            if material.users == 0:
                bpy.data.materials.remove(material)
