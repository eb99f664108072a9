"""Hide or Show, Isolate and Show All: Blender's own hiding of faces, segment by segment."""

from __future__ import annotations

import bpy
import numpy as np
from bpy.props import IntProperty

from ...core.mesh.triangle_mesh import BoolArray, IntArray
from ...core.message import Message
from ..outputs.part_attributes import labels_on
from ..scene.attributes import read_bools, read_ints, write_bools
from ..scene.simulations import check_may_change
from ..scene.topology import at_corners
from ..workflow import segment_list
from . import _needs, _report
from ._base import BaseOperator


def _mode_that_hides(context: bpy.types.Context) -> Message | None:
    """A message outside of Edit Mode of a mesh."""
    if context.mode == "EDIT_MESH":
        return None
    return Message("Switch to Edit Mode first: Object Mode also shows hidden faces")


class _HidesFaces(BaseOperator):
    """Shared by the three operators, which say for each face whether it is hidden."""

    bl_options = {"REGISTER", "UNDO"}

    needs = (_mode_that_hides, _needs.active_segment)

    def hidden(self, labels: IntArray, before: BoolArray, settings: bpy.types.PropertyGroup) -> BoolArray:
        """(p,) whether each face is hidden afterward, given the part of each and whether it was hidden before."""
        raise NotImplementedError

    def run(self, context: bpy.types.Context) -> set[str]:
        settings = context.scene.wks_segment
        meshes, count = segment_list.meshes_of(segment_list.labeled(settings)), 0
        with segment_list.leaving_edit_mode(context):
            for mesh in meshes:
                labels = labels_on(mesh)
                if labels is not None:
                    check_may_change(mesh)
                    hidden = self.hidden(labels, read_bools(mesh.polygons, "hide"), settings)
                    _hide(mesh, hidden)
                    count += int(hidden.sum())
            segment_list.fill(settings)
        message = Message("{count:,} faces are hidden", count=count) if count else "No faces are hidden"
        _report.tell(self, {"INFO"}, message)
        return {"FINISHED"}


class WKS_SEGMENT_OT_hide_segment(_HidesFaces, bpy.types.Operator):
    """Hide the faces of a segment in Edit Mode, Sculpt Mode and while painting, or show them again"""

    bl_idname = "wks_segment.hide_segment"
    bl_label = "Hide or Show Segment"

    part: IntProperty(
        name="Segment", description="Number of the segment, -1 for the active one", default=-1, min=-1,
        options={"SKIP_SAVE"},
    )  # fmt: skip

    def hidden(self, labels: IntArray, before: BoolArray, settings: bpy.types.PropertyGroup) -> BoolArray:
        part = self.part if self.part >= 0 else segment_list.active_part(settings)
        is_shown = any(item.number == part and not item.hidden for item in settings.segments)
        return np.where(labels == part, is_shown, before)


class WKS_SEGMENT_OT_isolate_segment(_HidesFaces, bpy.types.Operator):
    """Hide all faces except those of the active segment, in Edit Mode, Sculpt Mode and while painting"""

    bl_idname = "wks_segment.isolate_segment"
    bl_label = "Isolate Segment"

    def hidden(self, labels: IntArray, before: BoolArray, settings: bpy.types.PropertyGroup) -> BoolArray:
        return np.asarray(labels != segment_list.active_part(settings))


class WKS_SEGMENT_OT_show_segments(_HidesFaces, bpy.types.Operator):
    """Show the faces of all segments"""

    bl_idname = "wks_segment.show_segments"
    bl_label = "Show All Segments"

    needs = (_needs.object_or_edit_mode, _needs.active_segment)

    def hidden(self, labels: IntArray, before: BoolArray, settings: bpy.types.PropertyGroup) -> BoolArray:
        return np.zeros_like(before)


def _hide(mesh: bpy.types.Mesh, hidden: BoolArray) -> None:
    """Hide these faces, and the vertices and edges that only hidden faces have."""
    corners = at_corners(mesh, hidden)
    for elements, index_name in ((mesh.vertices, "vertex_index"), (mesh.edges, "edge_index")):
        indices = read_ints(mesh.loops, index_name)
        elements_hidden = read_bools(elements, "hide")
        elements_hidden[indices] = True
        elements_hidden[indices[~corners]] = False
        write_bools(elements, "hide", elements_hidden)
    write_bools(mesh.polygons, "hide", hidden)
    mesh.update()
