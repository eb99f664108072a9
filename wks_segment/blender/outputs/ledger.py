"""The ledger of a mesh: a custom property that lists what we wrote to it, so that Clear takes exactly that back."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any
from zlib import crc32

import bpy
from numpy.typing import NDArray

from ...core.message import Message
from ..scene.attributes import write_attribute
from ..scene.vertex_group_access import free_name
from .own_property import OwnProperty

LEDGER = "wks_segment_note"
"""Name of the custom property. It and its keys never change, since files of older versions must be cleared as well."""
MARK = "mark"
"""Key of the number that tells faces which were written with this ledger from those of meshes that were joined."""
_PROPERTY = OwnProperty(LEDGER, MARK, "faces")


class Ledger:
    """What we wrote to a mesh: names of attributes and vertex groups, ranges of slots, and what was active before.

    Entries are kept on the mesh at once, so that Clear also mends a mesh when writing broke off in between.
    """

    def __init__(self, mesh: bpy.types.Mesh) -> None:
        self._mesh = mesh
        found = _PROPERTY.of(mesh)
        self._entries: dict[str, Any] = {} if found is None else found.to_dict()
        self.warnings: list[Message] = []
        """What the user should know of what was taken back. Not kept on the mesh."""

    def __contains__(self, key: str) -> bool:
        return key in self._entries

    def __getitem__(self, key: str) -> Any:
        return self._entries[key]

    def __setitem__(self, key: str, value: Any) -> None:
        if not self._entries:
            self.begin(())
        _PROPERTY.of(self._mesh)[key] = value
        self._entries[key] = value

    def get(self, key: str, default: Any) -> Any:
        """The entry, or the default if there is none."""
        return self._entries.get(key, default)

    def remove(self, key: str) -> None:
        """Remove an entry, if it is there."""
        if key in self._entries:
            del self._entries[key], _PROPERTY.of(self._mesh)[key]

    def begin(self, kept: Iterable[str]) -> None:
        """Begin anew with only these entries of before."""
        self._entries = {key: self._entries[key] for key in kept if key in self}
        self._entries[MARK] = _mark_of(self._mesh)
        _PROPERTY.put(self._mesh, self._entries)

    def delete(self) -> None:
        """Remove the ledger from the mesh."""
        _PROPERTY.delete(self._mesh)
        self._entries = {}

    def add_attribute(self, key: str, name: str, data_type: str, domain: str, values: NDArray[Any]) -> None:
        """Add an attribute with these values to the mesh and enter its name: a name that is taken gets a number."""
        attribute = self._mesh.attributes.new(free_name(self._mesh, name), data_type, domain)
        self[key] = attribute.name
        write_attribute(attribute, values)

    def attribute(self, key: str) -> bpy.types.Attribute | None:
        """The attribute of ours whose name is entered under a key, if it is still there."""
        return self._mesh.attributes.get(self.get(key, ""))

    def remove_attribute(self, key: str) -> None:
        """Remove the attribute whose name is entered under a key, if it is still there."""
        attribute = self.attribute(key)
        if attribute is not None:
            self._mesh.attributes.remove(attribute)


def has_ledger(mesh: bpy.types.Mesh) -> bool:
    """Whether a mesh carries a ledger of ours, rather than none or somebody else's property of that name."""
    return _PROPERTY.of(mesh) is not None


def _mark_of(mesh: bpy.types.Mesh) -> int:
    """A number above 0 that is another for each mesh of a file."""
    return crc32(mesh.name.encode()) >> 1 | 1
