"""Find Named Parts."""

from __future__ import annotations

import bpy

from ..workflow.live_session import session_of
from ..workflow.starter_models import StarterJob
from . import _needs
from ._base import LabelOperator


class WKS_SEGMENT_OT_name_parts(LabelOperator, bpy.types.Operator):
    """Find Named Parts."""

    bl_idname = "wks_segment.name_parts"
    bl_label = "Find Named Parts"
    bl_description = (
        "Find head, arms, legs and other named parts of the selected person or animal, by the models that come with "
        "the extension. Needs neither poses nor a rig"
    )
    bl_options = {"REGISTER", "UNDO"}

    needs = (_needs.no_job, _needs.object_mode, _needs.selected_mesh)
    verb = "Applied"

    def read(self, context: bpy.types.Context) -> StarterJob:
        """Read the selected objects and the starter models."""
        return StarterJob.reading(context, session_of(context).cache)

    def write_result(self, context: bpy.types.Context) -> set[str]:
        """Keep the model that fits in the scene, write the labels and report them."""
        self.job.guard.check_fully()  # before anything is changed
        if isinstance(self.job, StarterJob):
            self.job.keep_starter(self.job.guard.scene().wks_segment)
        return super().write_result(context)
