"""Writes a material slot for each part and takes the slots back."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np

from ...core.mesh.triangle_mesh import IntArray
from ..parts import part_ids
from ..parts.palette import linear
from ..parts.part_style import Style
from ..scene.attributes import read_attribute, read_ints, write_ints
from .ledger import NOTE, add_attribute, note_of

OWN_MATERIALS = "wks_segment_own_material"
"""Face attribute that keeps the material index of each face from before ours."""
COMPONENT = "wks_segment_component"
"""Custom property of our materials: the part that they show."""
TEMPLATE = "wks_segment_template"
"""Custom property of our materials that are copies: the name of the material that they were copied from."""


def write_materials(
    mesh: bpy.types.Mesh, labels: IntArray, style: Style, template: bpy.types.Material | None = None
) -> None:  # fmt: skip
    """Add a slot for each of the (p,) parts of polygons, behind the mesh's own, with a material or a colored copy."""
    mesh[NOTE]["had_material_index"] = "material_index" in mesh.attributes
    mesh[NOTE]["first_slot"] = len(mesh.materials)
    before = read_ints(mesh.polygons, "material_index")
    add_attribute(mesh, "own_materials", OWN_MATERIALS, "INT", "FACE", before)
    slot = np.zeros(int(labels.max()) + 1, dtype=np.int32)
    for part in part_ids.unique_parts(labels):
        slot[part] = len(mesh.materials)
        mesh.materials.append(_material(part, style, template))
    mesh[NOTE]["last_slot"] = len(mesh.materials)
    write_ints(mesh.polygons, "material_index", slot[labels])


def remove_materials(mesh: bpy.types.Mesh, note: dict[str, Any]) -> None:
    """Take our slots out, and give faces that still use them their own material back."""
    if "first_slot" not in note:
        return
    restored = own_material_index(mesh)
    for index in reversed(_our_slots(mesh, note)):
        material = mesh.materials[index]
        if len(mesh.materials) == 1:
            mesh.materials.clear()  # pop would leave an empty slot on objects
        else:
            mesh.materials.pop(index=index)
        if material.users == 0:
            bpy.data.materials.remove(material)
    write_ints(mesh.polygons, "material_index", restored)
    if not note["had_material_index"] and "material_index" in mesh.attributes:
        mesh.attributes.remove(mesh.attributes["material_index"])


def own_material_index(mesh: bpy.types.Mesh) -> IntArray:
    """(p,) material slot of each polygon, without what `write_materials` wrote: the slots that Clear leaves."""
    note = note_of(mesh)
    now = read_ints(mesh.polygons, "material_index")
    ours = _our_slots(mesh, note)
    own = read_attribute(mesh, note.get("own_materials", ""))
    if own is None:
        own = np.zeros_like(now)
    # Slots that the user added behind ours move up.
    moved = now - np.searchsorted(ours, now)
    return np.where(np.isin(now, ours), own, moved)


def _material(part: int, style: Style, template: bpy.types.Material | None) -> bpy.types.Material:
    """The material of a part, one for all meshes."""
    source = "" if template is None else template.name
    for material in bpy.data.materials:
        if material.get(COMPONENT) == part and material.get(TEMPLATE, "") == source and material.library is None:
            return material
    name = style.name_of(part)
    if template is None:
        material = bpy.data.materials.new(name)
        if bpy.app.version < (5, 0, 0):  # from then on always true, and touching it warns
            material.use_nodes = True
    else:
        material = template.copy()
        material.name = name
        material[TEMPLATE] = source
        if material.asset_data is not None:
            material.asset_clear()
    material[COMPONENT] = part
    recolor_material(material, part, style)
    return material


def recolor_material(material: bpy.types.Material, part: int, style: Style) -> None:
    """Give a material the color of a part, in solid view and where its shader has a color of its own."""
    color = (*linear(style.colors_of(np.array([part]))[0]).tolist(), 1.0)
    material.diffuse_color = color
    for socket in _color_sockets(material):
        socket.default_value = color


def template_of(mesh: bpy.types.Mesh) -> bpy.types.Material | None:
    """The material that ours on a mesh are copies of, if they are and it is still there."""
    ours = (mesh.materials[slot] for slot in _our_slots(mesh, note_of(mesh)))
    return next((bpy.data.materials.get(material.get(TEMPLATE, "")) for material in ours), None)


def _color_sockets(material: bpy.types.Material) -> list[bpy.types.NodeSocket]:
    """Where the color of a material is chosen: an open Base Color, or the RGB node that feeds one."""
    sockets = []
    for node in material.node_tree.nodes if material.node_tree is not None else []:
        base = node.inputs.get("Base Color")
        if base is None:
            continue
        if not base.is_linked:
            sockets.append(base)
        elif base.links[0].from_node.type == "RGB":
            sockets.append(base.links[0].from_node.outputs[0])
    return sockets


def _our_slots(mesh: bpy.types.Mesh, note: dict[str, Any]) -> list[int]:
    """Material slots that are ours, in order."""
    first = note.get("first_slot", 0)
    last = note.get("last_slot", first)
    return [i for i, m in enumerate(mesh.materials) if first <= i < last and m is not None and COMPONENT in m]
