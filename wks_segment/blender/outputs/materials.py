"""A material for each part, in material slots behind the mesh's own."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import bpy
import numpy as np

from ...core.mesh.triangle_mesh import IntArray
from ..parts import part_ids
from ..parts.palette import linear
from ..parts.part_style import Style
from ..scene.attributes import read_attribute, read_ints, write_ints
from .ledger import Ledger
from .output import PartsOfMesh

OWN_MATERIALS = "wks_segment_own_material"
"""Face attribute that keeps the material index that each face had before ours."""
PART_PROPERTY = "wks_segment_component"
"""Custom property of our materials: the part that they show."""
TEMPLATE_PROPERTY = "wks_segment_template"
"""Custom property of our materials that are copies: the name of the material that they were copied from."""


class Materials:
    """A material slot for each part, with a plain material or a colored copy of a template."""

    def write(self, mesh: bpy.types.Mesh, parts: PartsOfMesh, ledger: Ledger) -> None:
        """Add the slots and assign them to the polygons, if the options ask for materials."""
        options, labels = parts.options, parts.of_polygons
        if not options.materials:
            return
        template = bpy.data.materials.get(options.template)
        ledger["had_material_index"] = "material_index" in mesh.attributes
        ledger["first_slot"] = len(mesh.materials)
        ledger.add_attribute("own_materials", OWN_MATERIALS, "INT", "FACE", read_ints(mesh.polygons, "material_index"))
        slot_of_part = np.zeros(int(labels.max()) + 1, dtype=np.int32)
        for part in part_ids.unique_parts(labels):
            slot_of_part[part] = len(mesh.materials)
            mesh.materials.append(_material(part, options.style, template))
        ledger["last_slot"] = len(mesh.materials)
        write_ints(mesh.polygons, "material_index", slot_of_part[labels])

    def take_back(self, mesh: bpy.types.Mesh, ledger: Ledger) -> None:
        """Remove our slots, and give faces that still use them their own material back."""
        if "first_slot" not in ledger:
            return
        restored = own_material_index(mesh)
        for index in reversed(_our_slots(mesh, ledger)):
            material = mesh.materials[index]
            if len(mesh.materials) == 1:
                mesh.materials.clear()  # pop would leave an empty slot on objects
            else:
                mesh.materials.pop(index=index)
            if material.users == 0:
                bpy.data.materials.remove(material)
        write_ints(mesh.polygons, "material_index", restored)
        if not ledger["had_material_index"] and "material_index" in mesh.attributes:
            mesh.attributes.remove(mesh.attributes["material_index"])
        ledger.remove_attribute("own_materials")


def own_material_index(mesh: bpy.types.Mesh) -> IntArray:
    """(p,) index of the material slot of each polygon that Clear would leave."""
    ledger = Ledger(mesh)
    index = read_ints(mesh.polygons, "material_index")
    our_slots = _our_slots(mesh, ledger)
    own = read_attribute(mesh, ledger.get("own_materials", ""))
    if own is None:
        own = np.zeros_like(index)
    # Slots that the user added behind ours move up.
    moved_up = index - np.searchsorted(our_slots, index)
    return np.where(np.isin(index, our_slots), own, moved_up)


def recolor_material(material: bpy.types.Material, part: int, style: Style) -> None:
    """Give a material the color of a part, in Solid view and where its shader has a color of its own."""
    color = (*linear(style.colors_of(np.array([part]))[0]).tolist(), 1.0)
    material.diffuse_color = color
    for socket in _color_sockets(material):
        socket.default_value = color


def template_on(mesh: bpy.types.Mesh) -> str:
    """Name of the material that ours on a mesh are copies of; empty if they are not, or it is gone."""
    ours = (mesh.materials[slot] for slot in _our_slots(mesh, Ledger(mesh)))
    template = next((bpy.data.materials.get(material.get(TEMPLATE_PROPERTY, "")) for material in ours), None)
    return "" if template is None else str(template.name)


@contextmanager
def materials_kept(mesh: bpy.types.Mesh) -> Iterator[None]:
    """Keep our materials on a mesh while their slots are removed and added again, with all that the artist changed."""
    ours = [material for material in mesh.materials if material is not None and PART_PROPERTY in material]
    fake_users = [material.use_fake_user for material in ours]
    for material in ours:
        material.use_fake_user = True
    try:
        yield
    finally:
        for material, fake_user in zip(ours, fake_users, strict=True):
            material.use_fake_user = fake_user
            if material.users == 0:
                bpy.data.materials.remove(material)


def _material(part: int, style: Style, template: bpy.types.Material | None) -> bpy.types.Material:
    """The material of a part, the same one on all meshes."""
    source = "" if template is None else template.name
    for material in bpy.data.materials:
        is_ours = material.get(PART_PROPERTY) == part and material.library is None
        if is_ours and material.get(TEMPLATE_PROPERTY, "") == source:
            return material
    name = style.name_of(part)
    if template is None:
        material = bpy.data.materials.new(name)
        if bpy.app.version < (5, 0, 0):  # always true since then, and setting it warns
            material.use_nodes = True
    else:
        material = template.copy()
        material.name = name
        material[TEMPLATE_PROPERTY] = source
        if material.asset_data is not None:
            material.asset_clear()
    material[PART_PROPERTY] = part
    recolor_material(material, part, style)
    return material


def _color_sockets(material: bpy.types.Material) -> list[bpy.types.NodeSocket]:
    """Sockets where the color of a material is chosen: an open Base Color, or the RGB node that feeds one."""
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


def _our_slots(mesh: bpy.types.Mesh, ledger: Ledger) -> list[int]:
    """Indices of the material slots that are ours, in order."""
    first = ledger.get("first_slot", 0)
    last = ledger.get("last_slot", first)
    return [i for i, m in enumerate(mesh.materials) if first <= i < last and m is not None and PART_PROPERTY in m]
