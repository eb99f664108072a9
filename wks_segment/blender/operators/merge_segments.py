"""Merge Into."""

from __future__ import annotations

from dataclasses import replace

import bpy
from bpy.props import IntProperty

from ...core.message import Message
from ..errors import UserError
from ..workflow import segment_list
from . import _needs, _report
from ._base import BaseOperator


def _two_segments(context: bpy.types.Context) -> Message | None:
    """A message if the list has fewer than two segments."""
    return Message("There is only one segment") if len(context.scene.wks_segment.segments) < 2 else None


class WKS_SEGMENT_OT_merge_segments(BaseOperator, bpy.types.Operator):
    """Merge Segment Into."""

    bl_idname = "wks_segment.merge_segments"
    bl_label = "Merge Segment Into"
    bl_description = (
        "Merge the active segment into another one, also when the model is applied again. Only objects with the "
        "same segments of this model change"
    )
    bl_options = {"REGISTER", "UNDO"}

    needs = (_needs.object_mode, _needs.active_segment, _two_segments)

    into: IntProperty(
        name="Into", description="Number of the segment to merge the active one into", default=-1, min=-1,
        options={"SKIP_SAVE"},
    )  # fmt: skip

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if self.into >= 0:
            return self.execute(context)
        bpy.ops.wm.call_menu(name="WKS_SEGMENT_MT_merge")
        return {"CANCELLED"}

    def run(self, context: bpy.types.Context) -> set[str]:
        settings = context.scene.wks_segment
        part, into = segment_list.active_part(settings), self.into
        if part is None or into == part or into not in [item.number for item in settings.segments]:
            raise UserError("Choose another segment to merge the active one into")
        labels = segment_list.active_labels(settings)
        notes, style = settings.notes(labels), settings.style(labels)
        merged_into = {other: into if old == part else old for other, old in notes.joined.items()}
        settings.keep_notes(replace(notes, joined=merged_into | {part: into}), labels)
        warnings = segment_list.rewrite_all(settings, labels)
        segment_list.activate(settings, into)
        _report.tell(
            self, {"INFO"},
            Message(
                "Merged {segment} into {other}: {left}",
                segment=style.name_of(part), other=style.name_of(into), left=segment_list.count_of(settings),
            ),
        )  # fmt: skip
        _report.tell_warnings(self, warnings)
        return {"FINISHED"}
