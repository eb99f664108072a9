"""Name from a preset."""

from __future__ import annotations

import bpy
from bpy.props import StringProperty

from ..workflow import segment_list
from . import _report


class WKS_SEGMENT_OT_name_segment(bpy.types.Operator):
    """Call the active segment so, and its other side too"""

    bl_idname = "wks_segment.name_segment"
    bl_label = "Name Segment"
    bl_options = {"REGISTER", "UNDO"}

    name: StringProperty(name="Name", description="What the segment is called. Empty: the number again")

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return _report.has_segments(cls, context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        settings = context.scene.wks_segment
        part = segment_list.active_part(settings)
        if part is not None:
            segment_list.rename(settings, part, self.name)
            _report.tell(self, {"INFO"}, f"Named {settings.style().name_of(part)}")
        return {"FINISHED"}
