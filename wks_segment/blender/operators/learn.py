"""Learn and Segment."""

from __future__ import annotations

import bpy

from ..work import Work
from . import feedback
from .running import RunsWork


class WKS_SEGMENT_OT_learn(RunsWork, bpy.types.Operator):
    """Learn the parts of a character from its poses, and color them"""

    bl_idname = "wks_segment.learn"
    bl_label = "Learn and Segment"
    bl_options = {"REGISTER", "UNDO"}

    learns = True
    verb = "Learned"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return (
            feedback.no_job_runs(cls, context)
            and feedback.in_object_mode(cls, context)
            and feedback.has_selected_mesh(cls, context)
        )

    def read(self, context: bpy.types.Context) -> Work:
        """Read poses and settings."""
        return Work.learning(context)
