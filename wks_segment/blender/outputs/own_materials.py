"""Which material each face had before ours, found again whatever happened to slots in between.

Slots are removed, moved and cleaned up, and objects are joined, so an index alone does not say which material a face
had. Each face also keeps a number made of the material's name, and the ledger the materials themselves, which can be
renamed.
"""

from __future__ import annotations

from typing import Any
from zlib import crc32

import bpy
import numpy as np

from ...core.mesh.triangle_mesh import BoolArray, IntArray
from ..parts import part_ids
from ..scene.attributes import read_attribute, read_ints
from .ledger import Ledger, has_ledger
from .material_slots import slots_of_objects
from .part_attributes import labels_on
from .part_materials import is_as_made, part_of

OWN_MATERIALS = "wks_segment_own_material"
"""Face attribute that keeps the material index that each face had before ours."""
OWN_KEYS = "wks_segment_own_material_key"
"""Face attribute that keeps a number for the material that each face had before ours; 0 on faces that are new."""
BY_INDEX, NEW_FACE = -1, 0
"""Instead of the number of a material: only the index is known; nothing is known."""
KEYS = "own_material_keys"
"""Entry of the ledger for the name of that attribute."""
Material = bpy.types.Material


def key_of(material: Material | None) -> int:
    """Number of a material, above 0; also for a slot without a material."""
    return crc32(b"" if material is None else material.name_full.encode()) >> 1 | 1


def our_slots(mesh: bpy.types.Mesh, ledger: Ledger) -> list[int]:
    """Indices of the material slots that are ours, in order."""
    if ledger.attribute("own_materials") is None and "first_slot" not in ledger:
        return []
    # A material of ours that the artist had put into a slot before is the artist's there.
    own = [material for material in ledger.get("own_slots", {}).values() if part_of(material) is not None]
    found: list[int] = []
    parts: set[int] = set()
    of_objects = slots_of_objects(mesh)
    for index, material in enumerate(mesh.materials):
        part = part_of(material)
        if part is None:
            continue
        if material in own:
            own.remove(material)
        # A changed copy of our material in one more slot is the artist's, and so is what they put on an object.
        elif index not in of_objects and (part not in parts or is_as_made(material)):
            found.append(index)
            parts.add(part)
    return found


class TakenBackSlots:
    """What taking back our slots leaves of a mesh's slots.

    Attributes
    ----------
    kept : list of int
        Indices of the slots that stay.
    added : list
        Materials that get a new slot behind these, because faces had them and their slots are gone.
    index : (p,) int array
        Slot of each polygon afterward.
    left : (p,) bool array
        Whether a polygon keeps a slot of ours, because it is not known what it had.
    """

    def __init__(self, mesh: bpy.types.Mesh, ledger: Ledger) -> None:
        self._slots: list[Any] = list(mesh.materials)
        self._recorded = _recorded(ledger)
        known = _known_materials(mesh, ledger)
        index, ours = read_ints(mesh.polygons, "material_index"), our_slots(mesh, ledger)
        shown = np.minimum(index, max(len(self._slots) - 1, 0))
        in_ours = np.isin(shown, ours)
        given_back = in_ours | self._fallen(mesh, ledger, shown)
        own, keys = self._before_ours(mesh, ledger)
        is_known = (keys == BY_INDEX) | np.isin(keys, list(known))
        self.left = in_ours & ~is_known
        used = set(np.unique(shown[self.left]).tolist())
        self.kept = [i for i in range(len(self._slots)) if i not in ours or i in used]
        self.added: list[Material | None] = []
        # Slots that the artist added behind ours move up.
        removed = np.setdiff1d(np.arange(len(self._slots)), self.kept)
        self.index = index - np.searchsorted(removed, index)
        given_back &= is_known
        for slot, key in np.unique(np.stack([own, keys], axis=1)[given_back], axis=0).tolist():
            at = given_back & (own == slot) & (keys == key)
            self.index[at] = slot if key == BY_INDEX else self._slot_for(slot, known[key])

    def _before_ours(self, mesh: bpy.types.Mesh, ledger: Ledger) -> tuple[IntArray, IntArray]:
        """(p,) index that polygons had, and (p,) number of their material."""
        own = read_attribute(mesh, ledger.get("own_materials", ""))
        keys = read_attribute(mesh, ledger.get(KEYS, ""))
        own = np.zeros(len(mesh.polygons)) if own is None else own
        # Files of older versions have no numbers: there the index is all that is known.
        keys = np.full(len(mesh.polygons), BY_INDEX) if keys is None else keys
        if not self._recorded:
            keys = np.where(keys == NEW_FACE, key_of(None), keys)
        return own.astype(np.int64), keys.astype(np.int64)

    def _slot_for(self, own: int, material: Any) -> int:
        """Slot afterward of faces that had a material in a slot with this index; it is added if there is none."""
        slots, recorded = [*(self._slots[i] for i in self.kept), *self.added], self._recorded
        if own < len(slots) and slots[own] == material:
            return own
        # Blender shows the last material on faces with an index beyond the last slot.
        is_beyond = own >= len(slots) and slots[: len(recorded)] == recorded
        if is_beyond and material == (recorded[-1] if recorded else None):
            return own
        if material in slots:
            return slots.index(material)
        # The artist has put another material into the slot.
        if own < len(recorded) <= len(slots) and recorded[own] == material and slots[own] not in recorded:
            return own
        self.added.append(material)
        return len(slots)

    def _fallen(self, mesh: bpy.types.Mesh, ledger: Ledger, shown: IntArray) -> BoolArray:
        """Polygons in the slot to which Blender moved them when the slot of their part was removed."""
        labels, fallen = labels_on(mesh), np.zeros(len(shown), dtype=bool)
        if labels is None or ledger.attribute("own_materials") is None:
            return fallen
        if not self._slots:
            return ~fallen
        slot_of_part = {part_of(material): i for i, material in enumerate(self._slots)}
        before = [self._slots.index(material) for material in self._recorded if material in self._slots]
        for part in part_ids.unique_parts(labels):
            if part in slot_of_part:
                before.append(slot_of_part[part])
            else:
                fallen |= (labels == part) & (shown == (before[-1] if before else 0))
        return fallen


def record_slots(mesh: bpy.types.Mesh, ledger: Ledger) -> None:
    """Enter the materials of a mesh and those of its faces, before slots of ours are added."""
    own, index = list(mesh.materials), read_ints(mesh.polygons, "material_index")
    keys = np.array([key_of(material) for material in own] or [key_of(None)])
    ledger["had_material_index"] = "material_index" in mesh.attributes
    ledger["first_slot"] = len(own)
    ledger["own_slots"] = {str(i): material for i, material in enumerate(own) if material is not None}
    ledger["own_slot_keys"] = keys.tolist()
    ledger.add_attribute("own_materials", OWN_MATERIALS, "INT", "FACE", index)
    ledger.add_attribute(KEYS, OWN_KEYS, "INT", "FACE", keys[np.minimum(index, len(keys) - 1)])


def _recorded(ledger: Ledger) -> list[Any]:
    """The materials in the slots of a mesh before ours were added."""
    own = ledger.get("own_slots", {})
    return [own.get(str(i)) for i in range(ledger.get("first_slot", 0))]


def _known_materials(mesh: bpy.types.Mesh, ledger: Ledger) -> dict[int, Material | None]:
    """The material of each number: by its name, or as ledgers have it, which know a material that was renamed."""
    # An object that was joined leaves its mesh with its ledger in the file for a while.
    ledgers = [Ledger(other) for other in bpy.data.meshes if other != mesh and has_ledger(other)]
    known: dict[int, Material | None] = {}
    for other in (*ledgers, ledger):
        keys = list(other.get("own_slot_keys", []))
        known |= {key: material for key, material in zip(keys, _recorded(other), strict=False) if material is not None}
    for material in (*bpy.data.materials, *filter(None, mesh.materials)):
        known.setdefault(key_of(material), material)
    return known | {key_of(None): None}
