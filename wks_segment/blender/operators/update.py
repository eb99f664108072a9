"""Update Segments."""

from __future__ import annotations

import bpy

from ...core.message import Message
from ..workflow.live_session import NOTHING_TO_UPDATE, session_of
from ..workflow.update_job import UpdateJob
from . import _needs, _report
from ._base import JobOperator


def _labels_of_a_model(context: bpy.types.Context) -> Message | None:
    """A message if no labels that follow the settings are selected."""
    return None if session_of(context).can_update(context.scene) else Message(NOTHING_TO_UPDATE)


class WKS_SEGMENT_OT_update(JobOperator[UpdateJob], bpy.types.Operator):
    """Update Segments."""

    bl_idname = "wks_segment.update"
    bl_label = "Update Segments"
    bl_description = (
        "Update the segments of the selected objects to the settings, each by its own model. Needs no new "
        "learning. Faces by hand stay"
    )
    bl_options = {"UNDO"}

    needs = (_labels_of_a_model, _needs.no_job, _needs.object_mode)

    def read(self, context: bpy.types.Context) -> UpdateJob:
        """Read what was not kept of the selected objects."""
        return session_of(context).updated(context)

    def write_result(self, context: bpy.types.Context) -> set[str]:
        """Write the labels and report them."""
        return write_update(self, context, self.job, Message("Updated"))


def write_update(operator: bpy.types.Operator, context: bpy.types.Context, update: UpdateJob, verb: str) -> set[str]:
    """Write updated labels and report them."""
    session = session_of(context)
    session.write_all(update)
    session.follow(context.scene)
    for job in update.jobs:
        _report.finish(operator, verb, job.report)
    return {"FINISHED"}
