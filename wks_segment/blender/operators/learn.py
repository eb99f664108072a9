"""Learn and Segment."""

from __future__ import annotations

import bpy

from ..workflow.segmentation_job import Work
from . import _report
from ._base import RunsWork


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
            _report.no_job_runs(cls, context)
            and _report.in_object_mode(cls, context)
            and _report.has_selected_mesh(cls, context)
        )

    def read(self, context: bpy.types.Context) -> Work:
        """Read poses and settings."""
        return Work.learning(context)
