"""The colors of parts as the color attribute that the *Color ID* masks of the add-on Ucupaint read.

Such a mask is white on faces whose color differs from its own by less than 1/256 in each channel. Ucupaint's attribute
has 8 bits a channel, which is as coarse as this; ours has floats, so that a color copied from the list fits exactly.
"""

from __future__ import annotations

import bpy
import numpy as np

from ...core.mesh.triangle_mesh import BoolArray, FloatArray
from ...core.message import Message
from ..parts.part_style import Style
from ..scene.attributes import read_face_ints, read_floats, write_attribute
from ..scene.topology import at_corners
from .ledger import MARK, Ledger
from .output import PartsOfMesh
from .part_attributes import labels_on

COLOR_IDS = "__yp_color_id"
"""Name that Ucupaint looks for; a name with a number would be no use."""
UNCHANGED_COLOR = 1e-3
"""Difference of channels below which a color is still the one that was written."""


class UcupaintColors:
    """The attribute of Ucupaint's masks, unless the mesh has one of the artist's."""

    def write(self, mesh: bpy.types.Mesh, parts: PartsOfMesh, ledger: Ledger) -> None:
        """Add the attribute, if the options ask for it; an attribute that is there already stays as it is."""
        if not parts.options.ucupaint:
            return
        if COLOR_IDS in mesh.attributes:
            ledger.warnings.append(
                Message('"{mesh}" has color IDs of Ucupaint already, they stay as they are', mesh=mesh.name)
            )
            return
        # By name, since an index cannot be set to that of none.
        before = {name: getattr(mesh.attributes, name) for name in ("active_color_name", "default_color_name")}
        attribute = mesh.color_attributes.new(COLOR_IDS, "FLOAT_COLOR", "CORNER")
        for name, value in before.items():
            setattr(mesh.attributes, name, value)
        ledger["color_ids"] = attribute.name
        present, of_polygons = np.unique(parts.of_polygons, return_inverse=True)
        colors = parts.options.style.colors_of(present)
        ledger["color_id_parts"] = {str(part): color for part, color in zip(present, colors.tolist(), strict=True)}
        of_corners = colors[at_corners(mesh, of_polygons.ravel())]
        write_attribute(attribute, np.pad(_linear(of_corners), [(0, 0), (0, 1)], constant_values=1.0))

    def take_back(self, mesh: bpy.types.Mesh, ledger: Ledger) -> None:
        """Remove the attribute, unless the artist has filled faces with other colors since."""
        if ledger.attribute("color_ids") is None:
            return
        if _was_changed(mesh, ledger):
            ledger.warnings.append(
                Message('You have changed the color IDs of "{mesh}" in Ucupaint, they stay', mesh=mesh.name)
            )
        else:
            ledger.remove_attribute("color_ids")


def recolor_ids(mesh: bpy.types.Mesh, part: int, style: Style) -> None:
    """Give the faces of a part the color of the style, where color IDs were written and not changed since."""
    ledger, labels = Ledger(mesh), labels_on(mesh)
    attribute = ledger.attribute("color_ids")
    if labels is None or attribute is None or _was_changed(mesh, ledger):
        return
    [color] = style.colors_of(np.array([part])).tolist()
    colors = read_floats(attribute.data, "color", 4)
    colors[at_corners(mesh, labels == part), :3] = _linear(np.array(color))
    write_attribute(attribute, colors)
    ledger["color_id_parts"] = dict(ledger["color_id_parts"]) | {str(part): color}
    mesh.update()


def _linear(colors: FloatArray) -> FloatArray:
    """(…, 3) linear colors, as float attributes store them, given sRGB."""
    return np.where(colors <= 0.04045, colors / 12.92, ((colors + 0.055) / 1.055) ** 2.4)


def _was_changed(mesh: bpy.types.Mesh, ledger: Ledger) -> bool:
    """Whether faces that were written to with this ledger have another color than their part."""
    labels, attribute = labels_on(mesh), ledger.attribute("color_ids")
    if labels is None or attribute is None or (attribute.data_type, attribute.domain) != ("FLOAT_COLOR", "CORNER"):
        return True
    colors = read_floats(attribute.data, "color_srgb", 4)[:, :3].astype(np.float64)
    written = read_face_ints(mesh, ledger.get("written", ""))
    ours = np.ones(len(labels), dtype=bool) if written is None else written == ledger.get(MARK, 0)
    return any(
        _differs(colors, at_corners(mesh, ours & (labels == int(part))), np.array(color))
        for part, color in ledger.get("color_id_parts", {}).items()
    )


def _differs(colors: FloatArray, corners: BoolArray, color: FloatArray) -> bool:
    return bool((np.abs(colors[corners] - color) > UNCHANGED_COLOR).any())
