"""Transfer to Selected."""

from __future__ import annotations

from dataclasses import replace

import bpy

from ...core.message import Message
from ..outputs.origin import origin_of
from ..outputs.part_attributes import labels_on
from ..outputs.transfer import transfer_labels
from ..scene import poses as reader
from ..scene.characters import group, mesh_objects
from ..scene.mesh_arrays import Body
from ..workflow import pipeline
from ..workflow.pipeline import LabelRequest
from ..workflow.report import Report
from . import _needs, _report
from ._base import BaseOperator


def _labeled_active_object(context: bpy.types.Context) -> Message | None:
    """A message if the active object has no segments."""
    active = context.active_object
    if active is not None and active.type == "MESH" and labels_on(active.data) is not None:
        return None
    return Message("The active object has no segments: click an object that has segments last")


def _other_selected_mesh(context: bpy.types.Context) -> Message | None:
    """A message if no mesh object is selected beside the active one."""
    if set(mesh_objects(context.selected_objects)) - {context.active_object}:
        return None
    return Message("Select the target objects first, and last the object that has segments")


class WKS_SEGMENT_OT_transfer(BaseOperator, bpy.types.Operator):
    """Transfer to Selected."""

    bl_idname = "wks_segment.transfer"
    bl_label = "Transfer to Selected"
    bl_description = (
        "Give the segments of the active object to the other selected ones, such as an outfit, by the nearest "
        "surface. The active object stays as it is"
    )
    bl_options = {"REGISTER", "UNDO"}

    needs = (_needs.no_job, _needs.object_mode, _labeled_active_object, _other_selected_mesh)

    def run(self, context: bpy.types.Context) -> set[str]:
        settings = context.scene.wks_segment
        report = Report([])
        active = context.active_object
        labels = {}
        (source,) = reader.read_objects(context, group([active]))
        for obj in mesh_objects(context.selected_objects):
            if obj.data is not active.data:
                (character,) = group([obj])
                (target,) = reader.read_objects(context, [character])
                labels[character] = pipeline.filled(transfer_labels(source, target), Body.of(character))
        origin = replace(origin_of(active.data), job="", transferred=True)
        pipeline.write_outputs(settings, labels, LabelRequest.of(settings, labels), report, origin=origin)
        if settings.write_colors:
            _report.show_colors(context)
        _report.tell_warnings(self, report.warnings)
        if len(labels) == 1:
            _report.tell(self, {"INFO"}, "Transferred to 1 object")
        else:
            _report.tell(self, {"INFO"}, Message("Transferred to {count} objects", count=len(labels)))
        return {"FINISHED"}
