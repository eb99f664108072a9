"""Restore and Refresh."""

from __future__ import annotations

from dataclasses import replace

import bpy
import numpy as np

from ..outputs.overrides import keep_by_hand
from ..workflow import segment_list
from . import _report


class WKS_SEGMENT_OT_restore_segments(bpy.types.Operator):
    """Give back the segments of the model: merged, split and hand-made ones are gone, names and colors stay"""

    bl_idname = "wks_segment.restore_segments"
    bl_label = "Restore Segments of the Model"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not _report.has_segments(cls, context, "OBJECT"):
            return False
        settings = context.scene.wks_segment
        if not (settings.faces_by_hand or settings.notes().joined):
            _report.explain(cls, "The segments are those of the model")
            return False
        return True

    def execute(self, context: bpy.types.Context) -> set[str]:
        settings = context.scene.wks_segment
        for mesh in segment_list.meshes_of(segment_list.labeled(settings)):
            keep_by_hand(mesh, np.full(len(mesh.polygons), -1))
        settings.keep_notes(replace(settings.notes(), joined={}))
        segment_list.rewrite_all(settings)
        _report.tell(self, {"INFO"}, "The segments are those of the model")
        return {"FINISHED"}


class WKS_SEGMENT_OT_refresh_segments(bpy.types.Operator):
    """List the segments of the selected objects, or of all if none is selected"""

    bl_idname = "wks_segment.refresh_segments"
    bl_label = "Refresh List of Segments"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return _report.in_object_mode(cls, context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        segment_list.fill(context.scene.wks_segment)
        return {"FINISHED"}
