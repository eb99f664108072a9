"""Assign, New Segment and Forget: the segment of selected faces, by hand."""

from __future__ import annotations

import bpy
import numpy as np
from bpy.props import StringProperty

from ...core.message import Message
from ..outputs.overrides import by_hand, keep_by_hand
from ..scene.attributes import read_bools
from ..workflow import segment_list
from . import _needs, _report
from ._base import BaseOperator


def _faces_by_hand(context: bpy.types.Context) -> Message | None:
    """A message if no face was assigned to a segment by hand."""
    return None if context.scene.wks_segment.faces_by_hand else Message("No face was assigned by hand")


class WKS_SEGMENT_OT_assign_faces(BaseOperator, bpy.types.Operator):
    """Assign Faces to Segment."""

    bl_idname = "wks_segment.assign_faces"
    bl_label = "Assign Faces to Segment"
    bl_description = (
        "Assign the selected faces to the active segment. They stay there when settings change or a model is "
        "applied, until Forget or Clear"
    )
    bl_options = {"REGISTER", "UNDO"}

    needs = (_needs.edit_mode, _needs.active_segment)

    def run(self, context: bpy.types.Context) -> set[str]:
        return _assign(self, context, segment_list.active_part(context.scene.wks_segment))


class WKS_SEGMENT_OT_new_segment(BaseOperator, bpy.types.Operator):
    """New Segment from Faces."""

    bl_idname = "wks_segment.new_segment"
    bl_label = "New Segment from Faces"
    bl_description = (
        "Make a new segment of the selected faces. It stays when settings change or a model is applied, until "
        "Forget or Clear"
    )
    bl_options = {"REGISTER", "UNDO"}

    needs = (_needs.edit_mode, _needs.active_segment)

    name: StringProperty(
        name="Name", description="Name of the new segment", default="New Segment", options={"SKIP_SAVE"}
    )

    def run(self, context: bpy.types.Context) -> set[str]:
        return _assign(self, context, None, self.name)


class WKS_SEGMENT_OT_forget_faces(BaseOperator, bpy.types.Operator):
    """Forget Faces Assigned by Hand."""

    bl_idname = "wks_segment.forget_faces"
    bl_label = "Forget Faces Assigned by Hand"
    bl_description = (
        "Give the selected faces, in Object Mode all faces, the segment of the model again. Names, colors and "
        "merges stay"
    )
    bl_options = {"REGISTER", "UNDO"}

    needs = (_needs.object_or_edit_mode, _needs.active_segment, _faces_by_hand)

    def run(self, context: bpy.types.Context) -> set[str]:
        settings = context.scene.wks_segment
        selected_only = context.mode == "EDIT_MESH"
        objects, count = segment_list.labeled(settings), 0
        with segment_list.leaving_edit_mode(context):
            for mesh in segment_list.meshes_of(objects):
                parts = by_hand(mesh)
                forgotten = (parts >= 0) & (read_bools(mesh.polygons, "select") | (not selected_only))
                count += int(forgotten.sum())
                keep_by_hand(mesh, np.where(forgotten, -1, parts))
            warnings = segment_list.rewrite_all(settings, segment_list.active_labels(settings), objects)
        _report.tell(self, {"INFO"}, Message("Restored the segment of the model on {count:,} faces", count=count))
        _report.tell_warnings(self, warnings)
        return {"FINISHED"}


def _assign(operator: bpy.types.Operator, context: bpy.types.Context, part: int | None, name: str = "") -> set[str]:
    """Assign the selected faces to a part; without one to a new part with this name."""
    settings = context.scene.wks_segment
    labels = segment_list.active_labels(settings)
    # Objects that are not in Edit Mode can have selected faces as well, which are not visible.
    objects, warnings = [obj for obj in segment_list.labeled(settings) if obj.mode == "EDIT"], list[str]()
    with segment_list.leaving_edit_mode(context):
        selected = {mesh: read_bools(mesh.polygons, "select") for mesh in segment_list.meshes_of(objects)}
        count = sum(int(faces.sum()) for faces in selected.values())
        if count:
            if part is None:
                part = segment_list.make_part(settings, labels, name)
            for mesh, faces in selected.items():
                keep_by_hand(mesh, np.where(faces, part, by_hand(mesh)))
            warnings = segment_list.rewrite_all(settings, labels, objects)
            segment_list.activate(settings, part)
    if not count:
        _report.tell(operator, {"WARNING"}, "Select some faces of an object that has segments first")
        return {"CANCELLED"}
    segment = settings.style(labels).name_of(part)
    _report.tell(operator, {"INFO"}, Message("Assigned {count:,} faces to {segment}", count=count, segment=segment))
    _report.tell_warnings(operator, warnings)
    return {"FINISHED"}
