"""Learn and Segment."""

from __future__ import annotations

import bpy

from ..workflow.live_session import session_of
from ..workflow.segmentation_job import SegmentationJob
from . import _needs
from ._base import LabelOperator


class WKS_SEGMENT_OT_learn(LabelOperator, bpy.types.Operator):
    """Learn and Segment."""

    bl_idname = "wks_segment.learn"
    bl_label = "Learn and Segment"
    bl_description = (
        "Learn the segments of the selected character from its poses, and color them. Needs poses that differ. "
        "Your own materials, groups and attributes stay"
    )
    bl_options = {"REGISTER", "UNDO"}

    needs = (_needs.no_job, _needs.object_mode, _needs.selected_mesh)
    learns = True
    verb = "Learned"

    def read(self, context: bpy.types.Context) -> SegmentationJob:
        """Read the poses and the settings."""
        return SegmentationJob.learning(context, session_of(context).cache)
