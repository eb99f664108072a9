"""How operators run their work: in a thread while the window lives on, or at once for a script."""

from __future__ import annotations

from typing import Generic, Protocol, TypeVar

import bpy

from ...core import PoseSegmentation
from ...core.poses.describe import Progress
from ..errors import ChangedError, EndedError, TooLargeError, UserError
from ..props.settings import WKSSegmentSettings
from ..scene.change_guard import Watch
from ..scene.poses import Pose
from ..ui.messages import in_panel
from ..workflow import pipeline
from ..workflow.background_job import Job, desk_of, redraw
from ..workflow.live_session import session_of
from ..workflow.segmentation_job import Work
from . import _report
from ._tunable import Tunable

WRITABLE = ("OBJECT", "POSE")
"""Modes in which Blender's undo takes note of meshes."""


class Computes(Protocol):
    """Work that is read, computed without Blender, and written."""

    poses: list[Pose]
    watch: Watch

    @property
    def model(self) -> PoseSegmentation:
        """By which the poses are described."""

    def compute(self, progress: Progress) -> None:
        """The part for a thread."""


W = TypeVar("W", bound=Computes)


class RunsJob(Generic[W]):
    """An operator that runs work of some kind; it asks before a job above the user's limits, and without a window
    refuses it."""

    confirmed: bpy.props.BoolProperty(options={"HIDDEN", "SKIP_SAVE"})

    bl_label: str
    job: Job
    work: W
    asked = False
    """Whether the next call of `execute` is the answer to a question in the window."""

    def read(self, context: bpy.types.Context) -> W:
        """Read what the work needs; UserError if it cannot be used."""
        raise NotImplementedError

    def written(self, context: bpy.types.Context) -> set[str]:
        """Write what was computed and report."""
        raise NotImplementedError

    def take(self, settings: WKSSegmentSettings) -> None:
        """Hand what the operator was given to the scene."""

    def again(self, context: bpy.types.Context) -> W | None:
        """Of what is adjusted, the work with other settings; None where there is nothing to begin with."""
        return None

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Called by a button or a shortcut."""
        if not _report.has_window(context):
            return self.execute(context)
        self.take(context.scene.wks_segment)
        try:
            return self.started(context)
        except TooLargeError as error:
            self.confirmed = self.asked = True
            return context.window_manager.invoke_confirm(
                self, event, title=in_panel("Large Job"), message=in_panel(str(error)), confirm_text=in_panel("Go On")
            )
        except UserError as error:
            return self.refused(error)

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Called by a script, by a redo, or after the question."""
        self.take(context.scene.wks_segment)
        try:
            if self.asked:
                self.asked = False
                return self.started(context)
            self.work = self.again(context) or self.checked(context)
            with _report.cursor_progress(context) as progress:
                self.work.compute(progress)
            return self.written(context)
        except UserError as error:
            return self.refused(error)

    def started(self, context: bpy.types.Context) -> set[str]:
        """Read, and let a thread compute; UserError if it cannot be done."""
        self.begin(context)
        desk_of(context).tick(context)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def begin(self, context: bpy.types.Context) -> None:
        """Read, and lay the job on the desk."""
        self.work = self.checked(context)
        self.job = desk_of(context).start(self.bl_label, self.work.compute, self.work.watch.glance)

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Called for all that happens in the window: leave it to others, but for ESC and the timer."""
        if desk_of(context).job is not self.job:  # it broke off, and Blender calls on
            return {"CANCELLED"}
        if event.type == "ESC" and event.value == "PRESS" and not self.job.ending:
            self.job.end()
            return {"RUNNING_MODAL"}
        return self.step(context) if event.type == "TIMER" else {"PASS_THROUGH"}

    def step(self, context: bpy.types.Context) -> set[str]:
        """Look at the job; when it is over, write."""
        redraw(context)
        if not self.job.step():
            return {"PASS_THROUGH"}
        if context.mode not in WRITABLE and self.job.succeeded:
            self.job.stage = "Done, to be written in Object Mode"
            return {"PASS_THROUGH"}
        said = ""
        try:
            self.job.result()
            return self.written(context)
        except (ChangedError, EndedError) as error:
            self.job.end(str(error))
            said = self.job.epitaph
            _report.tell(self, {"WARNING"}, said)
            return {"CANCELLED"}
        except UserError as error:
            return self.refused(error)
        finally:
            desk_of(context).clear(said)

    def cancel(self, context: bpy.types.Context) -> None:
        """Called by Blender when it takes the window away."""
        self.job.end("its window was closed")
        desk_of(context).clear(self.job.epitaph)

    def checked(self, context: bpy.types.Context) -> W:
        """What was read; TooLargeError unless it is within the limits or the user has agreed."""
        work = self.read(context)
        if not self.confirmed:
            pipeline.check_limits(work.model, work.poses, context.scene.wks_segment)
        return work

    def refused(self, error: UserError) -> set[str]:
        """Tell why."""
        _report.tell(self, {"ERROR"}, str(error))
        return {"CANCELLED"}


class RunsWork(Tunable, RunsJob[Work]):
    """An operator that runs a `Work`: it labels, and shows the settings that labels follow."""

    learns = False
    """Whether its work is learning."""
    verb = ""
    """What it has done, for the status bar."""

    @property
    def is_adjusted(self) -> bool:
        """Whether it was undone to be done with other settings, in the panel Adjust Last Operation."""
        return bool(self.options.is_repeat)  # type: ignore[attr-defined]  # an operator's own

    def again(self, context: bpy.types.Context) -> Work | None:
        """Of what is adjusted, the work with other settings; None where there is nothing to begin with."""
        before = session_of(context).work
        if not self.is_adjusted or before is None or before.learns != self.learns:
            return None
        return before.again(context.scene.wks_segment)

    def written(self, context: bpy.types.Context) -> set[str]:
        """Write what was computed and report."""
        self.work.write()
        session_of(context).keep(self.work, self.work.watch.scene())
        if self.work.wanted.colors:
            _report.show_colors(context)
        return _report.finish(self, self.verb, self.work.report)
