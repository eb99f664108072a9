"""Custom properties of ours: groups of entries, told from the artist's properties that happen to have their names."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import count
from typing import Any

import bpy


class OwnProperty:
    """A custom property of data-blocks whose value is a group.

    Parameters
    ----------
    name : str
        Name of the property; a number is added on a data-block where the artist has a property of that name.
    marks : tuple of str
        Keys, one of which every group of ours has.
    """

    def __init__(self, name: str, *marks: str) -> None:
        self._name, self._marks = name, marks

    def of(self, block: bpy.types.ID) -> Any:
        """The group on a data-block; None if there is none of ours."""
        name = self._name_on(block)
        return None if name is None else block[name]

    def put(self, block: bpy.types.ID, entries: Mapping[str, Any]) -> None:
        """Set the group on a data-block."""
        name = self._name_on(block) or next(name for name in self._names() if name not in block)
        block[name] = dict(entries)

    def delete(self, block: bpy.types.ID) -> None:
        """Remove the group from a data-block, if it is there."""
        name = self._name_on(block)
        if name is not None:
            del block[name]

    def _name_on(self, block: bpy.types.ID) -> str | None:
        for name in self._names():
            if name not in block:
                return None
            value = block[name]
            if hasattr(value, "to_dict") and any(mark in value for mark in self._marks):
                return name
        return None

    def _names(self) -> Iterator[str]:
        yield self._name
        yield from (f"{self._name}.{i:03}" for i in count(1))
