"""Assign, New Segment and Forget: what the selected faces are, by hand."""

from __future__ import annotations

import bpy
import numpy as np
from bpy.props import StringProperty

from ..outputs.overrides import by_hand, keep_by_hand
from ..scene.attributes import read_bools
from ..workflow import segment_list
from . import _report


class WKS_SEGMENT_OT_assign_faces(bpy.types.Operator):
    """Let the selected faces be of the active segment, also when the model is applied again"""

    bl_idname = "wks_segment.assign_faces"
    bl_label = "Assign Faces to Segment"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return _report.has_segments(cls, context, "EDIT_MESH")

    def execute(self, context: bpy.types.Context) -> set[str]:
        return _assign(self, context, segment_list.active_part(context.scene.wks_segment))


class WKS_SEGMENT_OT_new_segment(bpy.types.Operator):
    """Make a new segment of the selected faces"""

    bl_idname = "wks_segment.new_segment"
    bl_label = "New Segment from Faces"
    bl_options = {"REGISTER", "UNDO"}

    name: StringProperty(
        name="Name", description="What the segment is called", default="New Segment", options={"SKIP_SAVE"}
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return _report.has_segments(cls, context, "EDIT_MESH")

    def execute(self, context: bpy.types.Context) -> set[str]:
        return _assign(self, context, None)


class WKS_SEGMENT_OT_forget_faces(bpy.types.Operator):
    """Give the selected faces (in Object Mode: all) the segment that the model gives them, not that by hand"""

    bl_idname = "wks_segment.forget_faces"
    bl_label = "Forget Faces Assigned by Hand"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not _report.has_segments(cls, context):
            return False
        if not context.scene.wks_segment.faces_by_hand:
            _report.explain(cls, "No face was assigned by hand")
            return False
        return True

    def execute(self, context: bpy.types.Context) -> set[str]:
        settings = context.scene.wks_segment
        chosen_only = context.mode == "EDIT_MESH"
        objects, count = segment_list.labeled(settings), 0
        with segment_list.object_mode(context):
            for mesh in segment_list.meshes_of(objects):
                given = by_hand(mesh)
                forgotten = (given >= 0) & (read_bools(mesh.polygons, "select") | (not chosen_only))
                count += int(forgotten.sum())
                keep_by_hand(mesh, np.where(forgotten, -1, given))
            segment_list.rewrite_all(settings, objects)
        _report.tell(self, {"INFO"}, f"{count} faces are as the model has them")
        return {"FINISHED"}


def _assign(operator: bpy.types.Operator, context: bpy.types.Context, part: int | None) -> set[str]:
    """Give the selected faces to a part; None: to a new one."""
    settings = context.scene.wks_segment
    # Faces of objects that are not in Edit Mode can be selected too, unseen.
    objects = [obj for obj in segment_list.labeled(settings) if obj.mode == "EDIT"]
    with segment_list.object_mode(context):
        chosen = {mesh: read_bools(mesh.polygons, "select") for mesh in segment_list.meshes_of(objects)}
        count = sum(int(selected.sum()) for selected in chosen.values())
        if count:
            if part is None:
                part = segment_list.make_part(settings, operator.name)
            for mesh, selected in chosen.items():
                keep_by_hand(mesh, np.where(selected, part, by_hand(mesh)))
            segment_list.rewrite_all(settings, objects)
            segment_list.activate(settings, part)
    if not count:
        _report.tell(operator, {"WARNING"}, "Select some faces of an object that has segments first")
        return {"CANCELLED"}
    _report.tell(operator, {"INFO"}, f"{count} faces are of {settings.style().name_of(part)} now")
    return {"FINISHED"}
