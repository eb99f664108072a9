"""Accept Preview."""

from __future__ import annotations

import bpy

from ...core.message import Message
from ...core.progress import Progress
from ..workflow.live_session import session_of
from . import _needs, _report
from ._base import BaseOperator
from .update import write_update


class WKS_SEGMENT_OT_accept(BaseOperator, bpy.types.Operator):
    """Write the segments that the preview shows"""

    bl_idname = "wks_segment.accept"
    bl_label = "Accept"
    bl_options = {"REGISTER", "UNDO"}

    needs = (_needs.preview, _needs.no_job, _needs.object_mode)

    def run(self, context: bpy.types.Context) -> set[str]:
        session = session_of(context)
        update = session.updated(context)
        if session.proposed is None or update is not session.proposed[1]:
            update.compute(Progress())
        if context.scene.wks_segment.write_colors:
            _report.show_colors(context)
        return write_update(self, context, update, Message("Accepted"))
