"""Names and colors of parts: the user's, or else those that belong to their number.

They belong to a *label set*: the parts that one model gives with one number of segments. Numbers of parts mean
something only within a set, so names, colors, merges and faces by hand of one set are never those of another.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ...core import PartNotes
from ...core.mesh.triangle_mesh import FloatArray, IntArray
from . import part_ids
from .palette import DEFAULT_PALETTE, RECIPES, colors_of, most_different, sided_palette


@dataclass(frozen=True)
class SetNotes(PartNotes):
    """What a user said about the parts of a label set, and how the others look.

    Attributes
    ----------
    looks
        For a segment that has another color of the palette than that of its own number, the number of that color.
    palette
        Name of the palette; empty for the one of the settings.
    """

    looks: Mapping[int, int] = field(default_factory=dict)
    palette: str = ""

    def as_json(self) -> dict[str, Any]:
        """Fields of a JSON object that `of_json` reads; empty ones are left out."""
        looks = {str(segment): self.looks[segment] for segment in sorted(self.looks)}
        extra = {"looks": looks, "palette": self.palette}
        return super().as_json() | {name: value for name, value in extra.items() if value}

    @classmethod
    def of_json(cls, content: Any) -> SetNotes:
        """The notes among the fields of a JSON object; ValueError if a field is damaged."""
        notes = cls.of(PartNotes.of_json(content))
        looks, palette = content.get("looks", {}), content.get("palette", "")
        try:
            looks = {int(segment): int(look) for segment, look in looks.items()}
        except (AttributeError, TypeError, ValueError) as error:
            raise ValueError("the colors of the palette are not numbers by segment") from error
        return replace(notes, looks=looks, palette=palette if palette in RECIPES else "")

    @classmethod
    def of(cls, notes: PartNotes) -> SetNotes:
        """Notes of a model, for a label set of it."""
        return cls(notes.names, notes.colors, notes.joined)

    def for_model(self, palette: str) -> PartNotes:
        """The notes for a model file, which knows colors but no palette."""
        style, looked = Style.of(self, palette), {}
        for segment in self.looks:
            for part in (segment, *part_ids.siblings_of(segment + part_ids.SIDE_STEP)):
                red, green, blue = style.colors_of(np.array(part)).tolist()
                looked[part] = (red, green, blue)
        return PartNotes(self.names, looked | dict(self.colors), self.joined)


@dataclass(frozen=True)
class Style:
    """Names and colors of the parts of a label set.

    Attributes
    ----------
    labels : str
        Key of the label set; empty for labels that no model gave.
    names : dict
        The user's names by the part's number; a side without one has that of its segment, and other parts have the name
        of `part_ids.default_name`.
    colors : dict
        The user's colors, (3,) sRGB from 0 to 1, by the part's number; other parts have a color of the palette.
    palette : str
        Name of the palette, one of `palette.RECIPES`.
    looks : dict
        Segments that have another color of the palette than that of their own number, and the number of that color.
    """

    names: Mapping[int, str] = field(default_factory=dict)
    colors: Mapping[int, FloatArray] = field(default_factory=dict)
    palette: str = DEFAULT_PALETTE
    looks: Mapping[int, int] = field(default_factory=dict)
    labels: str = ""

    @classmethod
    def of(cls, notes: SetNotes, palette: str = DEFAULT_PALETTE, labels: str = "") -> Style:
        """The style from a user's notes on a label set, with a palette for notes that name none."""
        colors = {part: np.array(color) for part, color in notes.colors.items()}
        return cls(notes.names, colors, notes.palette or palette, notes.looks, labels)

    def name_of(self, part: int) -> str:
        """Name of a part."""
        if part in self.names:
            return self.names[part]
        segment, side = part % part_ids.SIDE_STEP, part // part_ids.SIDE_STEP
        if side and segment in self.names:
            return self.names[segment] + part_ids.SIDE_SUFFIXES[side]
        return part_ids.default_name(part)

    def colors_of(self, numbers: IntArray) -> FloatArray:
        """(…, 3) sRGB color of each part, given (…) numbers."""
        colors = colors_of(self._looking(np.asarray(numbers)), self.palette).copy()
        for part, color in self.colors.items():
            colors[np.asarray(numbers) == part] = color
        return colors

    def free_look(self, parts: IntArray, among: range) -> int:
        """The number of the palette's color, among some, that looks most different from those of (k,) parts."""
        middle = sided_palette(self.palette)[0]
        candidates = [number for number in among if number not in self.looks.values()] or list(among)
        return candidates[most_different(middle[candidates], self.colors_of(parts))]

    def _looking(self, numbers: IntArray) -> IntArray:
        """(…) number of the part of the palette that each part looks like."""
        looking = np.array(numbers)
        for segment, look in self.looks.items():
            for side in range(len(part_ids.SIDE_SUFFIXES)):
                looking[numbers == segment + side * part_ids.SIDE_STEP] = look + side * part_ids.SIDE_STEP
        return looking


PLAIN = Style()
"""The style without any name or color of the user."""
