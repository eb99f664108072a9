"""Select Segment."""

from __future__ import annotations

import bmesh
import bpy
from bpy.props import BoolProperty

from ...core.message import Message
from ..outputs.part_attributes import label_attribute
from ..scene.simulations import check_may_change
from ..workflow import segment_list
from . import _needs, _report
from ._base import BaseOperator


class WKS_SEGMENT_OT_select_segment(BaseOperator, bpy.types.Operator):
    """Select the faces of the active segment in Edit Mode. Shift keeps the selection"""

    bl_idname = "wks_segment.select_segment"
    bl_label = "Select Segment"
    bl_options = {"REGISTER", "UNDO"}

    needs = (_needs.object_or_edit_mode, _needs.active_segment)

    extend: BoolProperty(name="Extend", description="Keep the current selection")

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        self.extend = event.shift
        return self.execute(context)

    def run(self, context: bpy.types.Context) -> set[str]:
        settings = context.scene.wks_segment
        part = segment_list.active_part(settings)
        objects = [obj for obj in segment_list.labeled(settings) if obj.visible_get()]
        if context.mode == "EDIT_MESH":
            objects = [obj for obj in objects if obj.mode == "EDIT"]
        if part is None or not objects:
            _report.tell(self, {"WARNING"}, "No object with segments is visible here")
            return {"CANCELLED"}
        context.scene.tool_settings.mesh_select_mode = (False, False, True)
        if context.mode == "OBJECT":
            for mesh in segment_list.meshes_of(objects):
                check_may_change(mesh)  # Edit Mode alone throws frames of a simulation away
            for obj in objects:
                obj.select_set(True)
            if context.view_layer.objects.active not in objects:
                context.view_layer.objects.active = objects[0]
            bpy.ops.object.mode_set(mode="EDIT")
        if not self.extend:
            bpy.ops.mesh.select_all(action="DESELECT")
        count = sum(_select(mesh, part) for mesh in segment_list.meshes_of(objects))
        segment = settings.style(segment_list.active_labels(settings)).name_of(part)
        _report.tell(self, {"INFO"}, Message("Selected {count:,} faces of {segment}", count=count, segment=segment))
        return {"FINISHED"}


def _select(mesh: bpy.types.Mesh, part: int) -> int:
    """Select the visible faces of a part in Edit Mode; return how many."""
    edit = bmesh.from_edit_mesh(mesh)
    labels = edit.faces.layers.int.get(label_attribute(mesh))
    faces = [] if labels is None else [face for face in edit.faces if face[labels] == part and not face.hide]
    for face in faces:
        face.select_set(True)
    bmesh.update_edit_mesh(mesh, loop_triangles=False, destructive=False)
    return len(faces)
