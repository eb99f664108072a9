"""What parts are called and how they are colored: as the user has it, else by their number."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from ...core import PartNotes
from ...core.mesh.triangle_mesh import FloatArray, IntArray
from . import part_ids
from .palette import DEFAULT_PALETTE, colors_of


@dataclass(frozen=True)
class Style:
    """Names and colors of parts.

    Attributes
    ----------
    names
        By the part's number; others are called as `parts.name_of` calls them.
    colors
        (3,) sRGB, 0 to 1, by the part's number; others have that of the palette.
    palette
        Name of the palette, one of `palette.RECIPES`.
    """

    names: Mapping[int, str] = field(default_factory=dict)
    colors: Mapping[int, FloatArray] = field(default_factory=dict)
    palette: str = DEFAULT_PALETTE

    @classmethod
    def of(cls, notes: PartNotes, of_others: str = DEFAULT_PALETTE) -> Style:
        """As a user has noted it, and the palette for other parts."""
        return cls(notes.names, {part: np.array(color) for part, color in notes.colors.items()}, of_others)

    def name_of(self, part: int) -> str:
        """As a person reads it."""
        return self.names.get(part) or part_ids.default_name(part)

    def colors_of(self, numbers: IntArray) -> FloatArray:
        """(…, 3) sRGB color of each part, given (…) numbers."""
        colors = colors_of(numbers, self.palette).copy()
        for part, color in self.colors.items():
            colors[np.asarray(numbers) == part] = color
        return colors


PLAIN = Style()
"""Nothing renamed, nothing recolored."""
