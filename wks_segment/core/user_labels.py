"""What a user says of parts: names, colors and merges, which the core only keeps with the model; and taught labels."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, TypeVar

from .message import Message

MOST_PARTS = 3000
"""Parts are numbered below this: segments up to 1000, and their left and right sides."""
LONGEST_NAME = 50
"""Maximum length of a name in letters: Blender cuts names off at 63 bytes, and vertex groups have a word before it."""
NOT_SAID = -1
"""Label of a face whose part is not said, when parts are taught."""
LEAST_FACES = 3
"""Fewest faces of a taught part on all learned meshes together: with fewer, a slip of the brush would be a part."""
Color = tuple[float, float, float]
Unlabeled = Literal["learn", "ignore"]
Note = TypeVar("Note")


class UnlikePartsError(ValueError):
    """Two taught parts are alike and not left and right; `parts` are their numbers."""

    def __init__(self, first: int, second: int) -> None:
        super().__init__(
            Message(
                "parts {first} and {second} cannot be told apart: they have the same shape, and are not left and "
                "right of each other. Teach them as one part",
                first=first,
                second=second,
            )
        )
        self.parts = first, second


@dataclass(frozen=True)
class PartNotes:
    """What a user said about parts, by their numbers; a part that is missing has its defaults.

    Attributes
    ----------
    names
        Names of parts, all different.
    colors
        sRGB colors of parts, 0 to 1.
    joined
        For a part that is merged into another one, the number of that other, which is itself merged into none.

    Examples
    --------
    >>> from wks_segment.core import PartNotes
    >>> notes = PartNotes(names={0: "Body", 1: "Tail"}, colors={1: (0.9, 0.2, 0.1)})
    >>> PartNotes.of_json(notes.as_json()) == notes
    True
    """

    names: Mapping[int, str] = field(default_factory=dict)
    colors: Mapping[int, Color] = field(default_factory=dict)
    joined: Mapping[int, int] = field(default_factory=dict)

    def as_json(self) -> dict[str, Any]:
        """Fields of a JSON object that `of_json` reads; empty ones are left out."""
        fields = {"part_names": self.names, "part_colors": self.colors, "joined_parts": self.joined}
        return {name: {str(part): notes[part] for part in sorted(notes)} for name, notes in fields.items() if notes}

    @classmethod
    def of_json(cls, content: Any) -> PartNotes:
        """The notes among the fields of a JSON object; ValueError if a field is damaged."""
        if not isinstance(content, dict):
            raise ValueError("the notes on parts have no named fields")
        notes = cls(
            _read_notes(content, "part_names", _name, Message("a name of up to {most} letters", most=LONGEST_NAME)),
            _read_notes(content, "part_colors", _color, Message("a color of three numbers from 0 to 1")),
            _read_notes(content, "joined_parts", _number, Message("the number of a part")),
        )
        if len(set(notes.names.values())) < len(notes.names):
            raise ValueError("part_names has a name twice")
        if notes.joined.keys() & set(notes.joined.values()):
            raise ValueError("joined_parts joins a part with one that is joined itself")
        return notes


def _read_notes(
    content: dict[str, Any], name: str, read: Callable[[Any], Note | None], expected: str
) -> dict[int, Note]:
    """Notes of one field, each read by a function that returns None for a damaged one."""
    entries = content.get(name, {})
    if not isinstance(entries, dict):
        raise ValueError(Message("{name} is not a list of entries by part", name=name))
    notes: dict[int, Note] = {}
    for key, value in entries.items():
        part = int(key) if key.isascii() and key.isdecimal() and len(key) < 5 else MOST_PARTS
        if part >= MOST_PARTS or part in notes:
            raise ValueError(
                Message("{name} has an entry {key!r}, which is not a part or is there twice", name=name, key=key[:20])
            )
        note = read(value)
        if note is None:
            raise ValueError(
                Message("{name} has for part {part} something other than {expected}", name=name, part=part,
                        expected=expected)
            )  # fmt: skip
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


def _number(value: Any) -> int | None:
    return value if type(value) is int and 0 <= value < MOST_PARTS else None
