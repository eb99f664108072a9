"""Transfer to Selected."""

from __future__ import annotations

import bpy

from .. import poses as reader
from .. import tasks
from ..bodies import Body
from ..characters import group, mesh_objects
from ..errors import UserError
from ..labels import labels_on
from ..report import Report
from ..tasks import Wanted
from ..transfer import transferred
from . import feedback


class WKS_SEGMENT_OT_transfer(bpy.types.Operator):
    """Give the segments of the active object to the other selected ones, as an outfit, by the nearest surface"""

    bl_idname = "wks_segment.transfer"
    bl_label = "Transfer to Selected"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not (feedback.no_job_runs(cls, context) and feedback.in_object_mode(cls, context)):
            return False
        active = context.active_object
        if active is None or active.type != "MESH" or labels_on(active.data) is None:
            feedback.explain(cls, "The active object, the one that was clicked last, has no segments")
            return False
        if not set(mesh_objects(context.selected_objects)) - {active}:
            feedback.explain(cls, "Select the objects that are to get segments, and last the one that has them")
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
                    labels[character] = tasks.filled(transferred(source, target), Body.of(character))
        except UserError as error:
            feedback.tell(self, {"ERROR"}, str(error))
            return {"CANCELLED"}
        tasks.write(settings, labels, Wanted.of(settings, labels), report)
        if settings.write_colors:
            feedback.show_colors(context)
        for warning in report.warnings:
            feedback.tell(self, {"WARNING"}, warning)
        targets = "1 object" if len(labels) == 1 else f"{len(labels)} objects"
        feedback.tell(self, {"INFO"}, f"Transferred to {targets}")
        return {"FINISHED"}
