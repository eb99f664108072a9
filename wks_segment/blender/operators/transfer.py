"""Transfer to Selected."""

from __future__ import annotations

import bpy

from ..errors import UserError
from ..outputs.labels import labels_on
from ..outputs.transfer import transferred
from ..scene import poses as reader
from ..scene.characters import group, mesh_objects
from ..scene.mesh_arrays import Body
from ..workflow import pipeline
from ..workflow.pipeline import Wanted
from ..workflow.report import Report
from . import _report


class WKS_SEGMENT_OT_transfer(bpy.types.Operator):
    """Give the segments of the active object to the other selected ones, as an outfit, by the nearest surface"""

    bl_idname = "wks_segment.transfer"
    bl_label = "Transfer to Selected"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not (_report.no_job_runs(cls, context) and _report.in_object_mode(cls, context)):
            return False
        active = context.active_object
        if active is None or active.type != "MESH" or labels_on(active.data) is None:
            _report.explain(cls, "The active object, the one that was clicked last, has no segments")
            return False
        if not set(mesh_objects(context.selected_objects)) - {active}:
            _report.explain(cls, "Select the objects that are to get segments, and last the one that has them")
            return False
        return True

    def execute(self, context: bpy.types.Context) -> set[str]:
        settings = context.scene.wks_segment
        report = Report([])
        active = context.active_object
        labels = {}
        try:
            (source,) = reader.read_objects(context, group([active]))
            for obj in mesh_objects(context.selected_objects):
                if obj.data is not active.data:
                    (character,) = group([obj])
                    (target,) = reader.read_objects(context, [character])
                    labels[character] = pipeline.filled(transferred(source, target), Body.of(character))
        except UserError as error:
            _report.tell(self, {"ERROR"}, str(error))
            return {"CANCELLED"}
        pipeline.write(settings, labels, Wanted.of(settings, labels), report)
        if settings.write_colors:
            _report.show_colors(context)
        for warning in report.warnings:
            _report.tell(self, {"WARNING"}, warning)
        targets = "1 object" if len(labels) == 1 else f"{len(labels)} objects"
        _report.tell(self, {"INFO"}, f"Transferred to {targets}")
        return {"FINISHED"}
