"""Discard Preview."""

from __future__ import annotations

import bpy

from ..workflow.live_session import session_of
from . import _report


class WKS_SEGMENT_OT_discard(bpy.types.Operator):
    """Take back the segments that are shown, and the settings that they are from"""

    bl_idname = "wks_segment.discard"
    bl_label = "Discard"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return _report.shows_preview(cls, context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        session_of(context).discard(context.scene)
        return {"FINISHED"}
