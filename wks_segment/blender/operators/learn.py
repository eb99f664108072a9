"""Learn and Segment."""

from __future__ import annotations

import bpy

from .. import tasks
from . import feedback


class WKS_SEGMENT_OT_learn(feedback.AsksFirst, bpy.types.Operator):
    """Learn the parts of a character from its poses, and color them"""

    bl_idname = "wks_segment.learn"
    bl_label = "Learn and Segment"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return feedback.in_object_mode(cls, context) and feedback.has_selected_mesh(cls, context)

    def work(self, context: bpy.types.Context) -> set[str]:
        """Read, learn, label and write; UserError if it cannot be done."""
        settings = context.scene.wks_segment
        report = tasks.Report([])
        with feedback.cursor_progress(context) as progress:
            poses = tasks.read_training_poses(context, settings, report)
            self.check_limits(context, settings.new_model(), poses)
            model, described = tasks.learn(poses, settings, report, progress)
            labels = tasks.label(model, poses, described, settings, report, progress)
            soft = tasks.soften(model, poses, described, labels, settings, report, progress)
            tasks.write(labels, settings, report, soft, renumbered=True)
            report.warnings += tasks.segment_warnings(model, report)
        names = list(dict.fromkeys(pose.character.name for pose in poses))
        settings.keep_model(model, [f"From {', '.join(names[:3])}{' …' * (len(names) > 3)}", *report.facts[:3]])
        if settings.write_colors:
            feedback.show_colors(context)
        return feedback.finish(self, "Learned", report)
