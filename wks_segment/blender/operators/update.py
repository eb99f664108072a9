"""Update Segments."""

from __future__ import annotations

import bpy

from ...core.message import Message
from ..workflow.live_session import NOTHING_TO_UPDATE, session_of
from . import _needs, _report
from ._base import BaseOperator


def _kept_job(context: bpy.types.Context) -> Message | None:
    """A message if the labels in this scene are not from the job that the session keeps."""
    return None if session_of(context).holds(context.scene) else Message(NOTHING_TO_UPDATE)


class WKS_SEGMENT_OT_update(BaseOperator, bpy.types.Operator):
    """Update the segments that were learned or applied last to the current settings"""

    bl_idname = "wks_segment.update"
    bl_label = "Update Segments"
    bl_options = {"UNDO"}

    needs = (_kept_job, _needs.no_job, _needs.object_mode)

    def run(self, context: bpy.types.Context) -> set[str]:
        job = session_of(context).update(context.scene)
        return _report.finish(self, Message("Updated"), job.report)
