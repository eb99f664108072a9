"""Base classes of the operators: what they need, how errors are reported, and how jobs run.

A job runs in a thread while the window stays responsive, or at once if a script calls the operator.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from typing import ClassVar, Generic, Protocol, TypeVar

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty

from ... import core
from ...core.message import Message, message_of
from ...core.progress import Progress
from ..errors import ChangedError, EndedError, TooLargeError, UserError
from ..props.settings import LABEL_SETTINGS, WKSSegmentSettings
from ..scene.poses import Pose
from ..ui.messages import in_panel
from ..workflow import pipeline
from ..workflow.all_or_nothing import all_or_nothing
from ..workflow.background_job import BackgroundJob, job_holder
from ..workflow.first_colors import first_colors_of
from ..workflow.live_session import session_of
from ..workflow.passing_message import redraw_sidebars
from ..workflow.segmentation_job import SegmentationJob
from . import _report
from ._needs import Need

WRITABLE_MODES = ("OBJECT", "POSE")
"""Modes in which Blender's undo records changes of meshes."""
SKIP_SAVE = {"options": {"SKIP_SAVE"}}


class BaseOperator:
    """An operator that needs some things, and reports a UserError that ends it."""

    needs: ClassVar[tuple[Need, ...]] = ()
    """What is needed before the operator can run; the first missing one is the tooltip of the gray button."""

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Whether all needs are met; explains the first that is not."""
        for need in cls.needs:
            missing = need(context)
            if missing is not None:
                _report.explain(cls, missing)
                return False
        return True

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Called by Blender."""
        try:
            with self.protection(context):
                return self.run(context)
        except UserError as error:
            return self.refuse(error)

    def protection(self, context: bpy.types.Context) -> AbstractContextManager[None]:
        """What `run` is done in: an error leaves everything as it was before."""
        # In Edit Mode it begins where that is left.
        return nullcontext() if context.mode == "EDIT_MESH" else all_or_nothing(context)

    def run(self, context: bpy.types.Context) -> set[str]:
        """Do what the operator is for; may raise UserError."""
        raise NotImplementedError

    def refuse(self, error: Exception) -> set[str]:
        """Report an error, and cancel."""
        _report.tell(self, {"ERROR"}, message_of(error))
        return {"CANCELLED"}


class Guard(Protocol):
    """What says whether the scene has changed since a job was read."""

    def check_quickly(self) -> None:
        """Raise ChangedError if a change can be seen without reading meshes."""


class ComputedJob(Protocol):
    """What an operator computes in a thread, between reading from Blender and writing to it."""

    @property
    def poses(self) -> Sequence[Pose]:
        """The poses that signatures are needed of."""

    @property
    def guard(self) -> Guard:
        """What says whether the scene has changed."""

    @property
    def model(self) -> core.PoseSegmentation:
        """The model that describes the poses, for the limits of time and memory."""

    def compute(self, progress: Progress) -> None:
        """Compute without Blender."""


J = TypeVar("J", bound=ComputedJob)


class JobOperator(BaseOperator, Generic[J]):
    """An operator that runs a job. It asks before a job above the user's limits, and refuses it without a window."""

    confirmed: BoolProperty(options={"HIDDEN", "SKIP_SAVE"})

    bl_label: str
    job: J
    """What is read, computed and written."""
    thread_job: BackgroundJob
    """The thread that computes it."""
    asked = False
    """Whether the next call of `execute` is the answer to the question about a large job."""

    def protection(self, context: bpy.types.Context) -> AbstractContextManager[None]:
        """None: computing changes nothing, and what is written at its end is protected by itself."""
        return nullcontext()

    def read(self, context: bpy.types.Context) -> J:
        """Read everything that the job needs; UserError if it cannot be used."""
        raise NotImplementedError

    def write_result(self, context: bpy.types.Context) -> set[str]:
        """Write the computed result and report it."""
        raise NotImplementedError

    def write_all_or_nothing(self, context: bpy.types.Context) -> set[str]:
        """Write and report the result; an error leaves everything as it was before."""
        members = [member.resolve() for pose in self.job.poses for member in pose.character.members]
        with all_or_nothing(context, [obj for obj in members if obj is not None]):
            return self.write_result(context)

    def take(self, settings: WKSSegmentSettings) -> None:
        """Hand properties of the operator to the scene's settings."""

    def adjust_last(self, context: bpy.types.Context) -> J | None:
        """The last job with the adjusted settings, if the operator is called by Adjust Last Operation."""
        return None

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Called by a button or a shortcut."""
        if not _report.has_window(context):
            return self.execute(context)
        self.take(context.scene.wks_segment)
        try:
            return self.start(context)
        except TooLargeError as error:
            self.confirmed = self.asked = True
            return context.window_manager.invoke_confirm(
                self, event, title=in_panel("Large Job"), message=in_panel(message_of(error)),
                confirm_text=in_panel("Go On"),
            )  # fmt: skip
        except UserError as error:
            return self.refuse(error)

    def run(self, context: bpy.types.Context) -> set[str]:
        """Called by a script, by Adjust Last Operation, or after the question about a large job."""
        self.take(context.scene.wks_segment)
        if self.asked:
            self.asked = False
            return self.start(context)
        self.job = self.adjust_last(context) or self.read_and_check(context)
        with _report.cursor_progress(context) as progress:
            self.job.compute(progress)
        return self.write_all_or_nothing(context)

    def start(self, context: bpy.types.Context) -> set[str]:
        """Read, start the thread and listen to the window's events; UserError if the job cannot be read."""
        self.start_thread(context)
        job_holder(context).start_timer(context)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def start_thread(self, context: bpy.types.Context) -> None:
        """Read, and start to compute in a thread."""
        self.job = self.in_thread(self.read_and_check(context))
        self.thread_job = job_holder(context).start(self.bl_label, self.job.compute, self.job.guard.check_quickly)

    def in_thread(self, job: J) -> J:
        """The job as it is computed in a thread, while somebody looks on."""
        return job

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Called for every event in the window; all but ESC and the timer are passed on."""
        if job_holder(context).job is not self.thread_job:  # an error has ended it, and Blender still calls
            return {"CANCELLED"}
        if event.type == "ESC" and event.value == "PRESS" and not self.thread_job.ending:
            self.thread_job.end()
            return {"RUNNING_MODAL"}
        return self.step(context) if event.type == "TIMER" else {"PASS_THROUGH"}

    def step(self, context: bpy.types.Context) -> set[str]:
        """Look after the job, and write the result when it is complete."""
        redraw_sidebars(context)
        if not self.thread_job.step():
            return {"PASS_THROUGH"}
        if context.mode not in WRITABLE_MODES and self.thread_job.succeeded:
            self.thread_job.stage = "Done: written once you are in Object Mode"
            return {"PASS_THROUGH"}
        message = ""
        try:
            self.thread_job.result()
            return self.write_all_or_nothing(context)
        except (ChangedError, EndedError) as error:
            self.thread_job.end(message_of(error))
            message = self.thread_job.end_message
            _report.tell(self, {"WARNING"}, message)
            return {"CANCELLED"}
        except UserError as error:
            return self.refuse(error)
        finally:
            job_holder(context).release(message)

    def cancel(self, context: bpy.types.Context) -> None:
        """Called by Blender when the window is closed."""
        self.thread_job.end(Message("its window was closed"))
        job_holder(context).release(self.thread_job.end_message)

    def read_and_check(self, context: bpy.types.Context) -> J:
        """Read the job; TooLargeError if it is above the limits and the user has not agreed."""
        job = self.read(context)
        if not self.confirmed:
            pipeline.check_limits(job.model, job.poses, context.scene.wks_segment)
        return job


class LabelOperator(JobOperator[SegmentationJob]):
    """An operator that labels meshes. It shows the settings that labels follow in Adjust Last Operation.

    A setting that the caller gives goes to the scene; the others are taken from there.
    """

    n_segments: IntProperty(**LABEL_SETTINGS["n_segments"], **SKIP_SAVE)
    auto_segments: BoolProperty(**LABEL_SETTINGS["auto_segments"], **SKIP_SAVE)
    sides: EnumProperty(**LABEL_SETTINGS["sides"], **SKIP_SAVE)
    smoothness: FloatProperty(**LABEL_SETTINGS["smoothness"], **SKIP_SAVE)
    min_share: FloatProperty(**LABEL_SETTINGS["min_share"], **SKIP_SAVE)

    learns = False
    """Whether the job learns a model."""
    verb = ""
    """What was done, for the status bar."""

    def take(self, settings: WKSSegmentSettings) -> None:
        """Hand given properties to the scene's settings, and take the others from there."""
        for name in LABEL_SETTINGS:
            if self.properties.is_property_set(name):  # type: ignore[attr-defined]  # an operator's own
                setattr(settings, name, getattr(self, name))
            else:
                setattr(self, name, getattr(settings, name))

    @property
    def is_adjusted(self) -> bool:
        """Whether Adjust Last Operation has undone the operator and runs it again with other settings."""
        return bool(self.options.is_repeat)  # type: ignore[attr-defined]  # an operator's own

    def adjust_last(self, context: bpy.types.Context) -> SegmentationJob | None:
        """The last job with the adjusted settings; None if there is none of this kind."""
        last = session_of(context).job
        if not self.is_adjusted or last is None or last.learns != self.learns:
            return None
        return last.with_settings(context.scene.wks_segment)

    def in_thread(self, job: SegmentationJob) -> SegmentationJob:
        """The job, with a draft for whoever waits, if the result is shown as colors."""
        return replace(job, drafts=job.request.outputs.colors)

    def step(self, context: bpy.types.Context) -> set[str]:
        """Look after the job, and show its draft until it ends."""
        colors, result = first_colors_of(context), {"CANCELLED"}
        try:
            result = super().step(context)
        finally:
            if result != {"PASS_THROUGH"} or self.thread_job.ending:
                colors.hide()
        if result == {"PASS_THROUGH"} and not self.thread_job.ending and session_of(context).proposed is None:
            colors.follow(context, self.job.draft)
        return result

    def cancel(self, context: bpy.types.Context) -> None:
        """Called by Blender when the window is closed."""
        first_colors_of(context).hide()
        super().cancel(context)

    def write_result(self, context: bpy.types.Context) -> set[str]:
        """Write the labels and report them."""
        session = session_of(context)
        session.write(self.job)
        session.follow(context.scene)  # settings can have been changed while the job ran
        if self.job.request.outputs.colors:
            _report.show_colors(context)
        return _report.finish(self, self.verb, self.job.report)
