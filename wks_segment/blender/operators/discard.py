"""Discard Preview."""

from __future__ import annotations

import bpy

from ..workflow.live_session import session_of
from . import _needs
from ._base import BaseOperator


class WKS_SEGMENT_OT_discard(BaseOperator, bpy.types.Operator):
    """Hide the previewed segments and set the fields back. The written segments stay"""

    bl_idname = "wks_segment.discard"
    bl_label = "Discard"
    bl_options = {"REGISTER", "UNDO"}

    needs = (_needs.preview,)

    def run(self, context: bpy.types.Context) -> set[str]:
        session_of(context).discard(context.scene)
        return {"FINISHED"}
