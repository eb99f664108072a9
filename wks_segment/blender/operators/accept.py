"""Accept Preview."""

from __future__ import annotations

import bpy

from ...core.message import Message
from ..workflow.live_session import session_of
from . import _needs, _report
from ._base import BaseOperator


class WKS_SEGMENT_OT_accept(BaseOperator, bpy.types.Operator):
    """Write the previewed segments"""

    bl_idname = "wks_segment.accept"
    bl_label = "Accept"
    bl_options = {"REGISTER", "UNDO"}

    needs = (_needs.preview, _needs.no_job, _needs.object_mode)

    def run(self, context: bpy.types.Context) -> set[str]:
        job = session_of(context).update(context.scene)
        if job.request.outputs.colors:
            _report.show_colors(context)
        return _report.finish(self, Message("Accepted"), job.report)
