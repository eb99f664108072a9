"""Cancel."""

from __future__ import annotations

import bpy

from ...core.message import Message
from ..workflow.background_job import job_holder
from ._base import BaseOperator


def _running_job(context: bpy.types.Context) -> Message | None:
    """A message if no job is running."""
    return Message("No job is running") if job_holder(context).job is None else None


class WKS_SEGMENT_OT_cancel(BaseOperator, bpy.types.Operator):
    """End the running job without writing anything (ESC)"""

    bl_idname = "wks_segment.cancel"
    bl_label = "Cancel"
    bl_options = {"INTERNAL"}

    needs = (_running_job,)

    def run(self, context: bpy.types.Context) -> set[str]:
        job = job_holder(context).job
        assert job is not None  # as polled
        job.end()
        return {"FINISHED"}
