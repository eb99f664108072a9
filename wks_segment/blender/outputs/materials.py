"""A material for each part, in material slots behind the mesh's own."""

from __future__ import annotations

import bpy
import numpy as np

from ...core.mesh.triangle_mesh import IntArray
from ...core.message import Message
from ..parts import part_ids
from ..scene.attributes import read_ints, write_ints
from ..scene.characters import quoted
from .ledger import Ledger
from .material_slots import change_slots
from .output import PartsOfMesh
from .own_materials import KEYS, TakenBackSlots, our_slots, record_slots
from .part_materials import TEMPLATE_PROPERTY, is_as_made, material_of_part, unused
from .restore_point import remove


class Materials:
    """A material slot for each part, with a plain material or a colored copy of a template."""

    def write(self, mesh: bpy.types.Mesh, parts: PartsOfMesh, ledger: Ledger) -> None:
        """Add the slots and assign them to the polygons, if the options ask for materials."""
        options, labels = parts.options, parts.of_polygons
        if not options.materials:
            return
        template = bpy.data.materials.get(options.template)
        record_slots(mesh, ledger)
        slot_of_part = np.zeros(int(labels.max()) + 1, dtype=np.int32)
        for part in part_ids.unique_parts(labels):
            slot_of_part[part] = len(mesh.materials)
            mesh.materials.append(material_of_part(part, options.style, template))
        ledger["last_slot"] = len(mesh.materials)
        write_ints(mesh.polygons, "material_index", slot_of_part[labels])

    def take_back(self, mesh: bpy.types.Mesh, ledger: Ledger) -> None:
        """Remove our slots, and give faces their own material back, whatever happened to slots in between.

        Faces whose own material is not known keep their slot. Materials that the artist changed stay in the file.
        """
        if ledger.attribute("own_materials") is None and "first_slot" not in ledger:
            return
        slots = TakenBackSlots(mesh, ledger)
        _warn_of_left(mesh, slots, ledger)
        ledger.remove("own_slots")  # which can hold on to a material as a user
        change_slots(mesh, slots.kept, slots.added)
        write_ints(mesh.polygons, "material_index", slots.index)
        if not ledger.get("had_material_index", True) and not slots.index.any() and "material_index" in mesh.attributes:
            mesh.attributes.remove(mesh.attributes["material_index"])
        for key in ("own_materials", KEYS):
            ledger.remove_attribute(key)
        for material in unused():
            if is_as_made(material):
                remove(material)


def own_material_index(mesh: bpy.types.Mesh) -> IntArray:
    """(p,) index of the material slot of each polygon that Clear would leave."""
    return TakenBackSlots(mesh, Ledger(mesh)).index


def template_on(mesh: bpy.types.Mesh) -> str:
    """Name of the material that ours on a mesh are copies of; empty if they are not, or it is gone."""
    ours = (mesh.materials[slot] for slot in our_slots(mesh, Ledger(mesh)))
    template = next((bpy.data.materials.get(material.get(TEMPLATE_PROPERTY, "")) for material in ours), None)
    return "" if template is None else str(template.name)


def _warn_of_left(mesh: bpy.types.Mesh, slots: TakenBackSlots, ledger: Ledger) -> None:
    if slots.left.any():
        used = np.unique(read_ints(mesh.polygons, "material_index")[slots.left]).tolist()
        ledger.warnings.append(
            Message(
                '{count:,} faces of "{mesh}" keep {materials}: which material they had before is not known',
                count=int(slots.left.sum()),
                mesh=mesh.name,
                materials=quoted(mesh.materials[i].name for i in used),
            )
        )
