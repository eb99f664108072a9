"""Update Segments."""

from __future__ import annotations

import bpy

from ..errors import UserError
from ..workflow.live_session import NOTHING, session_of
from . import _report


class WKS_SEGMENT_OT_update(bpy.types.Operator):
    """Find the segments of what was learned or applied last anew, with the settings as they are now"""

    bl_idname = "wks_segment.update"
    bl_label = "Update Segments"
    bl_options = {"UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not session_of(context).holds(context.scene):
            _report.explain(cls, NOTHING)
            return False
        return _report.no_job_runs(cls, context) and _report.in_object_mode(cls, context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        try:
            work = session_of(context).update(context.scene)
        except UserError as error:
            _report.tell(self, {"ERROR"}, str(error))
            return {"CANCELLED"}
        return _report.finish(self, "Updated", work.report)
