"""Accept Preview."""

from __future__ import annotations

import bpy

from ..errors import UserError
from ..workflow.live_session import session_of
from . import _report


class WKS_SEGMENT_OT_accept(bpy.types.Operator):
    """Write the segments that are shown"""

    bl_idname = "wks_segment.accept"
    bl_label = "Accept"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return (
            _report.shows_preview(cls, context)
            and _report.no_job_runs(cls, context)
            and _report.in_object_mode(cls, context)
        )

    def execute(self, context: bpy.types.Context) -> set[str]:
        try:
            work = session_of(context).update(context.scene)
        except UserError as error:
            _report.tell(self, {"ERROR"}, str(error))
            return {"CANCELLED"}
        if work.wanted.colors:
            _report.show_colors(context)
        return _report.finish(self, "Accepted", work.report)
