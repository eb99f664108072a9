"""What a user has said of a model's parts: their names, their colors, and which are one. The core only keeps it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, TypeVar

MOST_PARTS = 3000
"""Parts are numbered below this."""
LONGEST_NAME = 50
"""Letters: Blender cuts names off at 63 bytes, and those of vertex groups have a word before."""
Color = tuple[float, float, float]
T = TypeVar("T")


@dataclass(frozen=True)
class PartNotes:
    """Notes on parts, by their number; a part without any is as the program has it.

    Attributes
    ----------
    names
        No two the same.
    colors
        sRGB, 0 to 1.
    joined
        For a part that is joined with another, the other, which is joined with none itself.
    """

    names: Mapping[int, str] = field(default_factory=dict)
    colors: Mapping[int, Color] = field(default_factory=dict)
    joined: Mapping[int, int] = field(default_factory=dict)

    def as_json(self) -> dict[str, Any]:
        """What `of_json` reads, without fields that say nothing."""
        fields = {"part_names": self.names, "part_colors": self.colors, "joined_parts": self.joined}
        return {name: {str(part): notes[part] for part in sorted(notes)} for name, notes in fields.items() if notes}

    @classmethod
    def of_json(cls, content: Any) -> PartNotes:
        """The notes among the fields of a JSON object; ValueError if one is damaged."""
        if not isinstance(content, dict):
            raise ValueError("there are no named fields")
        notes = cls(
            _read(content, "part_names", _name, f"a name of up to {LONGEST_NAME} letters"),
            _read(content, "part_colors", _color, "a color of three numbers from 0 to 1"),
            _read(content, "joined_parts", _part, "a part"),
        )
        if len(set(notes.names.values())) < len(notes.names):
            raise ValueError("part_names has a name twice")
        if notes.joined.keys() & set(notes.joined.values()):
            raise ValueError("joined_parts joins a part with one that is joined itself")
        return notes


def _read(content: dict[str, Any], name: str, read: Callable[[Any], T | None], kind: str) -> dict[int, T]:
    given = content.get(name, {})
    if not isinstance(given, dict):
        raise ValueError(f"{name} has no names of its entries")
    notes: dict[int, T] = {}
    for key, value in given.items():
        part = int(key) if key.isascii() and key.isdecimal() and len(key) < 5 else MOST_PARTS
        if part >= MOST_PARTS or part in notes:
            raise ValueError(f"{name} has an entry {key[:20]!r}, which is no part or is there twice")
        note = read(value)
        if note is None:
            raise ValueError(f"{name} has for part {part} something else than {kind}")
        notes[part] = note
    return notes


def _name(value: Any) -> str | None:
    fits = isinstance(value, str) and value == value.strip() and 0 < len(value) <= LONGEST_NAME and value.isprintable()
    return value if fits else None


def _color(value: Any) -> Color | None:
    if not isinstance(value, list | tuple) or len(value) != 3:
        return None
    if not all(type(channel) in (int, float) and 0 <= channel <= 1 for channel in value):
        return None
    red, green, blue = map(float, value)
    return red, green, blue


def _part(value: Any) -> int | None:
    return value if type(value) is int and 0 <= value < MOST_PARTS else None
