"""Material slots of a mesh and of the objects that use it: removed, added and restored together."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import bpy

Material = bpy.types.Material


class SlotState:
    """The slots of a mesh, and of each of its objects, which can have materials of their own in them."""

    def __init__(self, mesh: bpy.types.Mesh) -> None:
        self.materials: list[Material | None] = list(mesh.materials)
        self._links = {
            obj: [(slot.link, slot.material if slot.link == "OBJECT" else None) for slot in obj.material_slots]
            for obj in _objects_of(mesh)
        }
        self._active = {obj: obj.active_material_index for obj in self._links}

    def content(self) -> tuple[Any, ...]:
        """Everything, to be compared."""
        return self.materials, self._links, self._active

    def restore(self, mesh: bpy.types.Mesh) -> None:
        """Bring them back."""
        if list(mesh.materials) != self.materials:
            mesh.materials.clear()
            for material in self.materials:
                mesh.materials.append(material)
        self.take_over(mesh, range(len(self.materials)))
        for obj, active in self._active.items():
            obj.active_material_index = active

    def take_over(self, mesh: bpy.types.Mesh, kept: Sequence[int]) -> None:
        """Let the first slots of objects be what these slots were: Blender does not move them with those of a mesh."""
        for obj, links in self._links.items():
            for slot, (link, material) in zip(obj.material_slots, [links[i] for i in kept], strict=False):
                if slot.link != link:
                    slot.link = link
                if link == "OBJECT" and slot.material != material:
                    slot.material = material


def change_slots(mesh: bpy.types.Mesh, kept: Sequence[int], added: Sequence[Material | None]) -> None:
    """Keep these slots of a mesh only, in order, and add slots behind them; faces keep their indices."""
    before = SlotState(mesh)
    for index in reversed(range(len(mesh.materials))):
        if index not in kept:
            if len(mesh.materials) == 1:
                mesh.materials.clear()  # pop would leave an empty slot on objects
            else:
                mesh.materials.pop(index=index)
    for material in added:
        mesh.materials.append(material)
    before.take_over(mesh, kept)


def slots_of_objects(mesh: bpy.types.Mesh) -> set[int]:
    """Indices of the slots in which an object that uses a mesh has a material of its own."""
    objects = _objects_of(mesh)
    return {
        i for obj in objects for i, slot in enumerate(obj.material_slots) if slot.link == "OBJECT" and slot.material
    }


def _objects_of(mesh: bpy.types.Mesh) -> list[bpy.types.Object]:
    return [obj for obj in bpy.data.objects if obj.data == mesh and obj.library is None]
