"""The colors of parts as a color attribute, which Solid view and renderers show."""

from __future__ import annotations

import bpy
import numpy as np

from ..parts.part_style import Style
from ..scene.attributes import read_floats, write_attribute
from ..scene.topology import at_corners
from ..scene.vertex_group_access import free_name
from .ledger import Ledger
from .output import PartsOfMesh
from .part_attributes import labels_on

PART_COLORS = "wks_segment_color"


class ColorAttribute:
    """A color attribute of face corners, which becomes the active one."""

    def write(self, mesh: bpy.types.Mesh, parts: PartsOfMesh, ledger: Ledger) -> None:
        """Add the attribute, if the options ask for colors."""
        if not parts.options.colors:
            return
        active = mesh.color_attributes.active_color
        ledger["active_color"] = active.name if active is not None else ""
        # On corners, since Blender does not show colors of faces, and colors of vertices would blend.
        attribute = mesh.color_attributes.new(free_name(mesh, PART_COLORS), "BYTE_COLOR", "CORNER")
        ledger["colors"] = attribute.name
        colors = np.ones((len(mesh.loops), 4), dtype=np.float32)
        colors[:, :3] = parts.options.style.colors_of(at_corners(mesh, parts.of_polygons))
        write_attribute(attribute, colors)
        # What is rendered stays the user's, if there was something: only what Solid view shows changes.
        if mesh.color_attributes.render_color_index < 0:
            mesh.color_attributes.render_color_index = mesh.color_attributes.find(attribute.name)
        mesh.color_attributes.active_color = attribute

    def take_back(self, mesh: bpy.types.Mesh, ledger: Ledger) -> None:
        """Remove the attribute, and make the color attribute from before the active one."""
        ledger.remove_attribute("colors")
        # In Blender 5.2 the name of the active color attribute outlives the attribute.
        for setting in ("active_color_name", "default_color_name"):
            if "colors" in ledger and getattr(mesh.attributes, setting) == ledger["colors"]:
                setattr(mesh.attributes, setting, "")
        active = mesh.color_attributes.get(ledger.get("active_color", ""))
        if active is not None:
            mesh.color_attributes.active_color = active


def recolor_faces(mesh: bpy.types.Mesh, part: int, style: Style) -> None:
    """Give the faces of a part the color of the style, where colors were written."""
    labels, attribute = labels_on(mesh), mesh.color_attributes.get(Ledger(mesh).get("colors", ""))
    if labels is None or attribute is None:
        return
    colors = read_floats(attribute.data, "color_srgb", 4)
    colors[at_corners(mesh, labels == part), :3] = style.colors_of(np.array([part]))
    write_attribute(attribute, colors)
    mesh.update()
