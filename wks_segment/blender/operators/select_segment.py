"""Select Faces."""

from __future__ import annotations

import bpy
import numpy as np
from bpy.props import BoolProperty

from .. import segments
from ..edits import values
from ..labels import labels_on
from . import feedback


class WKS_SEGMENT_OT_select_segment(bpy.types.Operator):
    """Select the faces of the active segment, in Edit Mode. Shift: beside those that are selected"""

    bl_idname = "wks_segment.select_segment"
    bl_label = "Select Segment"
    bl_options = {"REGISTER", "UNDO"}

    extend: BoolProperty(name="Extend", description="Keep what is selected")

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return feedback.has_segments(cls, context)

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        self.extend = event.shift
        return self.execute(context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        settings = context.scene.wks_segment
        part = segments.active_part(settings)
        objects = [obj for obj in segments.labelled(settings) if obj.visible_get()]
        with segments.object_mode(context):
            count = sum(_select(mesh, part, self.extend) for mesh in segments.meshes_of(objects))
        if not count:
            self.report({"WARNING"}, f"No face of {settings.style().name_of(part)} is to be seen on these objects")
            return {"FINISHED"}
        context.scene.tool_settings.mesh_select_mode = (False, False, True)
        if context.mode == "OBJECT":
            for obj in objects:
                obj.select_set(True)
            if context.view_layer.objects.active not in objects:
                context.view_layer.objects.active = objects[0]
            bpy.ops.object.mode_set(mode="EDIT")
        self.report({"INFO"}, f"{count} faces of {settings.style().name_of(part)}")
        return {"FINISHED"}


def _select(mesh: bpy.types.Mesh, part: int | None, extend: bool) -> int:
    """Select the faces of a part that are to be seen; how many."""
    labels = labels_on(mesh)
    if labels is None:
        return 0
    chosen = (labels == part) & ~values(mesh.polygons, "hide", bool)
    selected = chosen | (values(mesh.polygons, "select", bool) & extend)
    corners = np.repeat(selected, values(mesh.polygons, "loop_total", np.int32))
    for elements, of_corner in ((mesh.vertices, "vertex_index"), (mesh.edges, "edge_index")):
        touched = np.zeros(len(elements), dtype=bool)
        touched[values(mesh.loops, of_corner, np.int32)[corners]] = True
        elements.foreach_set("select", touched)
    mesh.polygons.foreach_set("select", selected)
    return int(chosen.sum())
