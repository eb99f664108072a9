"""Cancel."""

from __future__ import annotations

import bpy

from ..workflow.background_job import desk_of
from . import _report


class WKS_SEGMENT_OT_cancel(bpy.types.Operator):
    """End the running job; nothing is written (ESC)"""

    bl_idname = "wks_segment.cancel"
    bl_label = "Cancel"
    bl_options = {"INTERNAL"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if desk_of(context).job is None:
            _report.explain(cls, "No job is running")
            return False
        return True

    def execute(self, context: bpy.types.Context) -> set[str]:
        job = desk_of(context).job
        assert job is not None  # as polled
        job.end()
        return {"FINISHED"}
