"""Apply to Selected."""

from __future__ import annotations

import bpy

from ..workflow.live_session import session_of
from ..workflow.segmentation_job import SegmentationJob
from . import _needs
from ._base import LabelOperator


class WKS_SEGMENT_OT_apply(LabelOperator, bpy.types.Operator):
    """Apply to Selected."""

    bl_idname = "wks_segment.apply"
    bl_label = "Apply to Selected"
    bl_description = (
        "Find the segments of the model in the selected objects: other poses, levels of detail or characters. "
        "Needs a model. Your own materials, groups and attributes stay"
    )
    bl_options = {"REGISTER", "UNDO"}

    needs = (_needs.model, _needs.no_job, _needs.object_mode, _needs.selected_mesh)
    verb = "Applied"

    def read(self, context: bpy.types.Context) -> SegmentationJob:
        """Read the selected objects, the model and the settings."""
        return SegmentationJob.applying(context, session_of(context).cache)
