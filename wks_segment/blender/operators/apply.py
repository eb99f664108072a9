"""Apply to Selected."""

from __future__ import annotations

import bpy

from .. import poses as reader
from .. import tasks
from ..characters import group, mesh_objects
from . import feedback


class WKS_SEGMENT_OT_apply(feedback.AsksFirst, bpy.types.Operator):
    """Find the learned parts in the selected objects as they are now: other poses, levels of detail or characters"""

    bl_idname = "wks_segment.apply"
    bl_label = "Apply to Selected"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not context.scene.wks_segment.model:
            cls.poll_message_set("No model yet: use Learn and Segment, or load a model")
            return False
        return feedback.in_object_mode(cls, context) and feedback.has_selected_mesh(cls, context)

    def work(self, context: bpy.types.Context) -> set[str]:
        """Read, label and write; UserError if it cannot be done."""
        settings = context.scene.wks_segment
        report = tasks.Report([])
        with feedback.cursor_progress(context) as progress:
            model = tasks.stored_model(settings)
            model.smoothness = settings.smoothness
            with report.stage("read"):
                report.poses = reader.read_objects(context, group(mesh_objects(context.selected_objects)))
            self.check_limits(context, model, report.poses)
            described = tasks.describe(model, report.poses, report, progress)
            labels = tasks.label(model, report.poses, described, settings, report, progress)
            soft = tasks.soften(model, report.poses, described, labels, settings, report, progress)
            tasks.write(labels, settings, report, soft)
        if settings.write_colors:
            feedback.show_colors(context)
        return feedback.finish(self, "Applied", report)
