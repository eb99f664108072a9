"""Clear."""

from __future__ import annotations

import bpy

from .. import segments
from ..characters import mesh_objects
from ..labels import clear_labels, has_labels
from . import feedback


class WKS_SEGMENT_OT_clear(bpy.types.Operator):
    """Remove what was written to the selected objects, and give back their own materials"""

    bl_idname = "wks_segment.clear"
    bl_label = "Clear"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not feedback.in_object_mode(cls, context):
            return False
        if not any(has_labels(obj.data) for obj in mesh_objects(context.selected_objects)):
            cls.poll_message_set("Select an object that has segments")
            return False
        return True

    def execute(self, context: bpy.types.Context) -> set[str]:
        meshes = {obj.data for obj in mesh_objects(context.selected_objects) if obj.data.library is None}
        cleared = sum(clear_labels(mesh) for mesh in meshes)
        context.scene.wks_segment.applied = ""
        segments.fill(context.scene.wks_segment)
        if not any(has_labels(mesh) for mesh in bpy.data.meshes):
            feedback.hide_colors(context)
        self.report({"INFO"}, f"Cleared the segments of {cleared} mesh{'es' * (cleared != 1)}")
        return {"FINISHED"}
