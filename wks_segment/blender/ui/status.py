"""What the panel says below its buttons: one text at a time, in a place that has always the same height."""

from __future__ import annotations

import re

import bpy

from ...core.message import Message
from ..outputs.origin import origin_of
from ..workflow import model_library, segment_list
from ..workflow.background_job import BackgroundJob, job_holder
from ..workflow.live_session import ASLEEP, session_of
from .messages import in_panel

PREVIEW = "Preview in the viewport only: Accept writes it, and the list follows"
NO_SEGMENTS = "No segments yet: learn a model, or apply one"


def status(context: bpy.types.Context) -> str:
    """What is to be said while no job runs: what just happened, what Live needs, or whose segments are shown."""
    session, settings = session_of(context), context.scene.wks_segment
    if session.message or job_holder(context).message:
        return session.message or job_holder(context).message
    if session.proposed is not None:
        return PREVIEW
    if settings.live and session.can_update(context.scene):
        if session.is_slow:
            return Message("Segments take {seconds:.0f} seconds here, too long for Live", seconds=session.seconds)
        if not session.holds(context.scene):
            return ASLEEP
    return whose_segments(context)


def whose_segments(context: bpy.types.Context) -> str:
    """The object whose settings and segments the panel shows, and the model that they are from."""
    settings = context.scene.wks_segment
    subject = segment_list.shown_object(settings)
    if subject is None:
        return NO_SEGMENTS
    origin = origin_of(subject.data)
    row = model_library.row_of(settings, origin.model)
    if origin.transferred:
        return Message('"{object}": segments transferred from another object', object=subject.name)
    if row is None:
        return Message('"{object}": segments without a model', object=subject.name)
    if row.name == subject.name:
        return Message('"{object}": segments of the model of this name', object=subject.name)
    return Message('"{object}": segments of the model "{name}"', object=subject.name, name=row.name)


def job_texts(job: BackgroundJob) -> tuple[str, str]:
    """Stage and time left of a job in the user's language: "Signature of Fox · 3 of 5" and "about 20 s left".

    The share that is done as long as the time left is unknown, and why the job ends once it was asked to.
    """
    if job.ending:
        return in_panel("Canceling"), in_panel(job.reason)
    stage = re.sub(r" \((\d+ \w+ \d+)\)$", r" · \1", in_panel(job.stage).replace('"', ""))
    return stage, in_panel(job.time_left) or f"{100 * job.share:.0f} %"
