"""Merge Into."""

from __future__ import annotations

from dataclasses import replace

import bpy
from bpy.props import IntProperty

from ..workflow import segment_list
from . import _report


class WKS_SEGMENT_OT_merge_segments(bpy.types.Operator):
    """Let the active segment be one with another, here and whenever the model is applied"""

    bl_idname = "wks_segment.merge_segments"
    bl_label = "Merge Segment Into"
    bl_options = {"REGISTER", "UNDO"}

    into: IntProperty(
        name="Into", description="Number of the segment that it becomes part of", default=-1, min=-1,
        options={"SKIP_SAVE"},
    )  # fmt: skip

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not _report.has_segments(cls, context, "OBJECT"):
            return False
        if len(context.scene.wks_segment.segments) < 2:
            _report.explain(cls, "There is only one segment")
            return False
        return True

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if self.into >= 0:
            return self.execute(context)
        bpy.ops.wm.call_menu(name="WKS_SEGMENT_MT_merge")
        return {"CANCELLED"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        settings = context.scene.wks_segment
        part, into = segment_list.active_part(settings), self.into
        if part is None or into == part or into not in [item.number for item in settings.segments]:
            _report.tell(self, {"ERROR"}, "Choose another segment of the list to merge the active one with")
            return {"CANCELLED"}
        notes, style = settings.notes(), settings.style()
        joined = {other: into if old == part else old for other, old in notes.joined.items()}
        settings.keep_notes(replace(notes, joined=joined | {part: into}))
        segment_list.rewrite_all(settings)
        segment_list.activate(settings, into)
        _report.tell(self, {"INFO"}, f"{style.name_of(part)} is part of {style.name_of(into)} now")
        return {"FINISHED"}
