"""Names and colors of parts: the user's, or else those that belong to their number."""

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
    names : dict
        The user's names by the part's number; other parts have the name of `part_ids.default_name`.
    colors : dict
        The user's colors, (3,) sRGB from 0 to 1, by the part's number; other parts have a color of the palette.
    palette : str
        Name of the palette, one of `palette.RECIPES`.
    """

    names: Mapping[int, str] = field(default_factory=dict)
    colors: Mapping[int, FloatArray] = field(default_factory=dict)
    palette: str = DEFAULT_PALETTE

    @classmethod
    def of(cls, notes: PartNotes, palette: str = DEFAULT_PALETTE) -> Style:
        """The style from a user's notes, with the palette for other parts."""
        return cls(notes.names, {part: np.array(color) for part, color in notes.colors.items()}, palette)

    def name_of(self, part: int) -> str:
        """Name of a part."""
        return self.names.get(part) or part_ids.default_name(part)

    def colors_of(self, numbers: IntArray) -> FloatArray:
        """(…, 3) sRGB color of each part, given (…) numbers."""
        colors = colors_of(numbers, self.palette).copy()
        for part, color in self.colors.items():
            colors[np.asarray(numbers) == part] = color
        return colors


PLAIN = Style()
"""The style without any name or color of the user."""
