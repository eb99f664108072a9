"""Name Segment, by a name of the menu."""

from __future__ import annotations

import bpy
from bpy.props import StringProperty

from ...core.message import Message
from ..workflow import segment_list
from . import _needs, _report
from ._base import BaseOperator


class WKS_SEGMENT_OT_name_segment(BaseOperator, bpy.types.Operator):
    """Give the active segment this name, and its other side the same with the other suffix"""

    bl_idname = "wks_segment.name_segment"
    bl_label = "Name Segment"
    bl_options = {"REGISTER", "UNDO"}

    needs = (_needs.object_or_edit_mode, _needs.active_segment)

    name: StringProperty(name="Name", description="Name of the segment, empty for its number")

    def run(self, context: bpy.types.Context) -> set[str]:
        settings = context.scene.wks_segment
        part = segment_list.active_part(settings)
        if part is not None:
            labels = segment_list.active_labels(settings)
            segment_list.rename(settings, labels, part, self.name)
            _report.tell(self, {"INFO"}, Message("Named {segment}", segment=settings.style(labels).name_of(part)))
        return {"FINISHED"}
