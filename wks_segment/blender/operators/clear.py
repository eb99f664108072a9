"""Clear."""

from __future__ import annotations

import bpy

from ..outputs.labels import clear_labels, has_labels
from ..outputs.separate import unite, whole_of
from ..scene.characters import selected_meshes
from ..workflow import segment_list
from . import _report


class WKS_SEGMENT_OT_clear(bpy.types.Operator):
    """Remove what was written to the selected objects, and give back their own materials"""

    bl_idname = "wks_segment.clear"
    bl_label = "Clear"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return _report.in_object_mode(cls, context) and _report.has_labeled_mesh(cls, context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        chosen = selected_meshes(context)
        names = {obj.name for obj in chosen}
        wholes = {whole for obj in chosen if (whole := whole_of(obj)) is not None}
        kept = sum(unite(context, whole) for whole in wholes)
        # Pieces are gone now, but for those that were worked on.
        there = wholes | {obj for obj in context.scene.objects if obj.name in names}
        meshes = {obj.data for obj in there if obj.data.library is None}
        cleared = sum(clear_labels(mesh) for mesh in meshes)
        context.scene.wks_segment.applied = ""
        segment_list.fill(context.scene.wks_segment)
        if not any(has_labels(mesh) for mesh in bpy.data.meshes):
            _report.hide_colors(context)
        of = "1 mesh" if cleared == 1 else f"{cleared} meshes"
        _report.tell(self, {"INFO"}, f"Cleared the segments of {of}")
        if kept:
            _report.tell(self, {"WARNING"}, f"{kept} separated objects were worked on since, and stay")
        return {"FINISHED"}
