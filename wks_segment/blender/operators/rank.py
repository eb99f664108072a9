"""Rank Models."""

from __future__ import annotations

import bpy

from ..props.preferences import model_folder
from ..workflow.model_ranking import RankWork
from . import _report
from ._base import RunsJob


class WKS_SEGMENT_OT_rank(RunsJob[RankWork], bpy.types.Operator):
    """Say which models of this scene and of the model folder fit the active character, and how surely"""

    bl_idname = "wks_segment.rank"
    bl_label = "Rank Models"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        # Not what is in the folder: this is asked whenever the panel is drawn, and the folder may be far away.
        if not (context.scene.wks_segment.model or model_folder(context)):
            _report.explain(cls, "No model yet: learn one, import one, or set Model Folder in the preferences")
            return False
        return (
            _report.no_job_runs(cls, context)
            and _report.in_object_mode(cls, context)
            and _report.has_selected_mesh(cls, context)
        )

    def read(self, context: bpy.types.Context) -> RankWork:
        """Read the models and the active character."""
        return RankWork.read(context)

    def written(self, context: bpy.types.Context) -> set[str]:
        """Show the ranking and report."""
        _report.tell(self, {"INFO"}, self.work.write())
        for warning in self.work.report.warnings:
            _report.tell(self, {"WARNING"}, warning)
        return {"FINISHED"}
