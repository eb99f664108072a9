"""Restore and Refresh."""

from __future__ import annotations

from dataclasses import replace

import bpy
import numpy as np

from ...core.message import Message
from ..outputs.overrides import keep_by_hand
from ..workflow import segment_list
from ..workflow.followed_settings import follow_active
from . import _needs, _report
from ._base import BaseOperator


def _edited_segments(context: bpy.types.Context) -> Message | None:
    """A message if the user has not merged, split or made a segment."""
    settings = context.scene.wks_segment
    merged = settings.notes(segment_list.active_labels(settings)).joined
    return (
        None
        if settings.faces_by_hand or merged
        else Message("The segments are as in the model: there is nothing to restore")
    )


class WKS_SEGMENT_OT_restore_segments(BaseOperator, bpy.types.Operator):
    """Take back all merging, splitting and assigning by hand. Names and colors stay"""

    bl_idname = "wks_segment.restore_segments"
    bl_label = "Restore Segments of the Model"
    bl_options = {"REGISTER", "UNDO"}

    needs = (_needs.object_mode, _needs.active_segment, _edited_segments)

    def run(self, context: bpy.types.Context) -> set[str]:
        settings = context.scene.wks_segment
        labels = segment_list.active_labels(settings)
        for mesh in segment_list.meshes_of(segment_list.labeled(settings)):
            keep_by_hand(mesh, np.full(len(mesh.polygons), -1))
        settings.keep_notes(replace(settings.notes(labels), joined={}), labels)
        warnings = segment_list.rewrite_all(settings, labels)
        _report.tell(self, {"INFO"}, Message("Restored the segments of the model"))
        _report.tell_warnings(self, warnings)
        return {"FINISHED"}


class WKS_SEGMENT_OT_refresh_segments(BaseOperator, bpy.types.Operator):
    """Show the settings and the segments of the active object"""

    bl_idname = "wks_segment.refresh_segments"
    bl_label = "Refresh List of Segments"
    bl_options = {"REGISTER", "UNDO"}

    needs = (_needs.object_mode,)

    def run(self, context: bpy.types.Context) -> set[str]:
        follow_active(context.scene.wks_segment)
        return {"FINISHED"}
