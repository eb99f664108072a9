"""Borders of parts as UV seams."""

from __future__ import annotations

import bpy

from ...core.mesh.triangle_mesh import BoolArray
from ..scene.attributes import read_attribute, read_bools, write_bools
from ..scene.topology import border_edges
from .ledger import Ledger
from .output import PartsOfMesh

OUR_SEAMS = "wks_segment_seam"
"""Edge attribute: whether we marked the seam of an edge."""
SEAM_ATTRIBUTES = ("uv_seam", ".uv_seam")
"""Blender's own edge attribute that holds seams: its name since Blender 5.0, and before."""


class Seams:
    """Seams on the edges between polygons of different parts, in addition to the artist's own seams."""

    def write(self, mesh: bpy.types.Mesh, parts: PartsOfMesh, ledger: Ledger) -> None:
        """Mark the edges between polygons of different parts, if the options ask for seams."""
        if not parts.options.seams:
            return
        own = read_bools(mesh.edges, "use_seam")
        ours = border_edges(mesh, parts.of_polygons) & ~own
        ledger["had_seams"] = _seam_attribute(mesh) is not None
        ledger.add_attribute("seams", OUR_SEAMS, "BOOLEAN", "EDGE", ours)
        write_bools(mesh.edges, "use_seam", own | ours)

    def take_back(self, mesh: bpy.types.Mesh, ledger: Ledger) -> None:
        """Remove the seams that we added."""
        if ledger.attribute("seams") is None:
            return
        own = own_seams(mesh)
        write_bools(mesh.edges, "use_seam", own)
        attribute = _seam_attribute(mesh)
        if not ledger.get("had_seams", True) and attribute is not None and not own.any():
            mesh.attributes.remove(attribute)
        ledger.remove_attribute("seams")


def own_seams(mesh: bpy.types.Mesh) -> BoolArray:
    """(e,) whether an edge has a seam of the artist: the seams that Clear leaves."""
    seams = read_bools(mesh.edges, "use_seam")
    ours = read_attribute(mesh, Ledger(mesh).get("seams", ""))
    return seams if ours is None else seams & ~ours.astype(bool)


def _seam_attribute(mesh: bpy.types.Mesh) -> bpy.types.Attribute | None:
    return next((mesh.attributes[name] for name in SEAM_ATTRIBUTES if name in mesh.attributes), None)
