"""Rank Models."""

from __future__ import annotations

import bpy

from ...core.message import Message
from ..props.preferences import model_folder
from ..workflow import model_library
from ..workflow.live_session import session_of
from ..workflow.model_ranking import RankingJob
from . import _needs, _report
from ._base import JobOperator


def _any_model(context: bpy.types.Context) -> Message | None:
    """A message if there is neither a model in this scene or the extension, nor a model folder.

    The folder itself is not searched, since this is called whenever the panel is drawn and the folder may be slow.
    """
    if context.scene.wks_segment.model or model_folder(context) or model_library.starters():
        return None
    return Message("No model yet: learn one, import one, or set Model Folder in the preferences of the add-on")


class WKS_SEGMENT_OT_rank(JobOperator[RankingJob], bpy.types.Operator):
    """Rank Models."""

    bl_idname = "wks_segment.rank"
    bl_label = "Rank Models"
    bl_description = (
        "Rank the models of this scene, of the model folder and of the extension by how well they fit the active "
        "character. Nothing is applied"
    )
    bl_options = {"REGISTER", "UNDO"}

    needs = (_any_model, _needs.no_job, _needs.object_mode, _needs.selected_mesh)

    def read(self, context: bpy.types.Context) -> RankingJob:
        """Read the models and the active character."""
        return RankingJob.read(context, session_of(context).cache)

    def write_result(self, context: bpy.types.Context) -> set[str]:
        """Show the ranking and report the verdict."""
        _report.tell(self, {"INFO"}, self.job.write())
        _report.tell_warnings(self, self.job.report.warnings)
        return {"FINISHED"}
