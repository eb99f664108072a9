"""What is written to meshes in addition to the numbers of parts."""

from __future__ import annotations

from dataclasses import dataclass

from ..parts.part_style import PLAIN, Style


@dataclass(frozen=True)
class OutputOptions:
    """What the settings ask to be written to meshes. Contains no Blender data, so that threads may use it.

    Attributes
    ----------
    colors, ucupaint, materials, face_sets, seams : bool
        Whether they are written.
    template : str
        Name of the material that the materials of parts are copies of; empty for plain ones.
    vertex_groups : "none", "hard" or "soft"
        Hard groups are made of the labels; soft ones need weights, and fall back to hard if there are none.
    style : Style
        Names and colors of parts.
    """

    colors: bool = True
    ucupaint: bool = False
    materials: bool = False
    template: str = ""
    vertex_groups: str = "none"
    face_sets: bool = False
    seams: bool = False
    style: Style = PLAIN


DEFAULT_OUTPUTS = OutputOptions()
"""Colors alone."""
