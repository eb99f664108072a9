"""Apply to Selected."""

from __future__ import annotations

import bpy

from ..workflow.segmentation_job import Work
from . import _report
from ._base import RunsWork


class WKS_SEGMENT_OT_apply(RunsWork, bpy.types.Operator):
    """Find the learned parts in the selected objects as they are now: other poses, levels of detail or characters"""

    bl_idname = "wks_segment.apply"
    bl_label = "Apply to Selected"
    bl_options = {"REGISTER", "UNDO"}

    verb = "Applied"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not context.scene.wks_segment.model:
            _report.explain(cls, "No model yet: use Learn and Segment, or import a model")
            return False
        return (
            _report.no_job_runs(cls, context)
            and _report.in_object_mode(cls, context)
            and _report.has_selected_mesh(cls, context)
        )

    def read(self, context: bpy.types.Context) -> Work:
        """Read the selected objects, the model and settings."""
        return Work.applying(context)
