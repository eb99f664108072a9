"""Separate by Segments."""

from __future__ import annotations

import bpy

from ..errors import UserError
from ..outputs.labels import labels_on
from ..outputs.separate import separate, whole_of
from ..scene.characters import group, selected_meshes
from . import _report


class WKS_SEGMENT_OT_separate(bpy.types.Operator):
    """Make an object of each segment of the selected objects. These are hidden, and come back with Clear"""

    bl_idname = "wks_segment.separate"
    bl_label = "Separate by Segments"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return (
            _report.no_job_runs(cls, context)
            and _report.in_object_mode(cls, context)
            and _report.has_labeled_mesh(cls, context)
        )

    def execute(self, context: bpy.types.Context) -> set[str]:
        style = context.scene.wks_segment.style()
        pieces = []
        try:
            for character in group(selected_meshes(context)):
                for obj in character.objects:
                    if whole_of(obj) is not None:
                        raise UserError(f'"{obj.name}" is separated already: Clear it first')
                    labels = labels_on(obj.data)
                    if labels is not None:
                        pieces += separate(context, obj, labels, style)
        except UserError as error:
            _report.tell(self, {"ERROR"}, str(error))
            return {"CANCELLED"}
        _report.tell(self, {"INFO"}, f"Separated into {len(pieces)} objects")
        return {"FINISHED"}
