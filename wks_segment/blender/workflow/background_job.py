"""Jobs that compute in a thread while the window stays responsive. One job runs at a time; `JobHolder` holds it.

The thread must not touch Blender. Blender's own thread looks after the job: a timer calls `BackgroundJob.step`.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any

import bpy
from bpy.app.handlers import persistent

from ...core.message import Message, message_of
from ...core.progress import Progress
from ..errors import ChangedError, EndedError, UserError
from .passing_message import PassingMessage

TIMER_INTERVAL = 0.1
"""Seconds between two looks at a job. With more the bar moves in jumps; with less Blender redraws for nothing."""
ESTIMATE_AFTER_SECONDS, ESTIMATE_AFTER_SHARE = 2.0, 0.2
"""Seconds and share of the work before the first estimate of the time left: an earlier one would be far off.
`python -m benchmarks.first_estimate` compares the first one with the truth."""
FORGETTING = 3
"""Power of the share by which what was said earlier counts less. With 1, first estimates were up to twice too long,
because the share rises late at the beginning; with more, a single leap decides."""
STANDING = 0.5
"""Least time left while the share stands, relative to what time and share would say if it was about to rise. With more
the shown time grows in each long step; with less it would run out before a step ends that takes longer than others."""
EXIT_WAIT = 3.0
"""Seconds to wait for the job when Blender quits or the extension is disabled. A job usually ends sooner; one that does
not must not keep Blender open."""
JOB_HOLDER = "wks_segment_job_holder"
"""Name of the job holder at the type of Blender's window manager."""
JOB_RUNNING = "A job is running: wait or cancel it"


class Canceled(Exception):  # noqa: N818  # not an error, only the way out of the thread
    """Raised in the thread by the progress of a job that is to end."""


class TimeLeft:
    """Estimate of the seconds that are left.

    The share of the work that is done grows by leaps, and is right when it has just risen: only then it counts, the
    more the later. While it stands the time left runs down.
    """

    def __init__(self) -> None:
        self._share = 0.0
        self._total: float | None = None
        self._left: float | None = None

    def update(self, seconds: float, share: float) -> None:
        """Take into account that a share of the work was done after some seconds."""
        if share > self._share:
            weight = 1.0 if self._total is None else 1 - (self._share / share) ** FORGETTING
            self._total = (self._total or 0.0) * (1 - weight) + seconds / share * weight
            self._share = share
        if self._total is not None and seconds >= ESTIMATE_AFTER_SECONDS and share >= ESTIMATE_AFTER_SHARE:
            self._left = max(self._total - seconds, STANDING * seconds * (1 / share - 1))

    @property
    def seconds(self) -> float | None:
        """The estimate; None as long as there is none."""
        return self._left

    @property
    def text(self) -> str:
        """The estimate for the user, rounded; empty as long as there is none."""
        if self._left is None:
            return ""
        if self._left < 5:
            return "a few seconds left"
        if self._left < 90:
            return Message("about {seconds} s left", seconds=5 * round(self._left / 5))
        return Message("about {minutes} min left", minutes=round(self._left / 60))


class BackgroundJob:
    """A computation in a thread.

    Parameters
    ----------
    name : str
        Name for the user, the label of the button.
    compute : callable
        The computation, given its progress; must not touch Blender.
    check : callable
        Raises ChangedError when the result has become useless; called in Blender's thread, many times a second.
    """

    def __init__(self, name: str, compute: Callable[[Progress], None], check: Callable[[], None]) -> None:
        self.name = name
        self.stage, self.share = "Starting", 0.0
        self._time_left = TimeLeft()
        self._compute, self._check = compute, check
        self._reason = ""
        self._ending = threading.Event()
        self._error: BaseException | None = None
        self._began = time.monotonic()
        # A daemon, so that Blender can quit without waiting for it.
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    def step(self) -> bool:
        """Look after the job from Blender's own thread; return whether the thread has ended."""
        over = not self._thread.is_alive()
        if not self.ending:
            self._time_left.update(time.monotonic() - self._began, self.share)
            try:
                self._check()
            except ChangedError as error:
                self.end(message_of(error))
        return over

    def end(self, reason: str = "") -> None:
        """Ask the thread to end as soon as it can; without a reason the user has canceled. The first call counts."""
        if not self.ending:
            self._reason = reason
            self._ending.set()

    def wait(self, seconds: float) -> None:
        """Wait until the thread has ended, but no longer than this."""
        self._thread.join(seconds)

    def result(self) -> None:
        """Raise the error that ended the thread, or EndedError if `end` was called."""
        if self.ending:
            raise EndedError(self.end_message)
        if self._error is not None:
            raise self._error

    @property
    def ending(self) -> bool:
        """Whether the job was asked to end."""
        return self._ending.is_set()

    @property
    def succeeded(self) -> bool:
        """Whether the computation is complete."""
        return not (self._thread.is_alive() or self.ending or self._error)

    @property
    def reason(self) -> str:
        """Why the job was asked to end; empty if the user canceled it."""
        return self._reason

    @property
    def time_left(self) -> str:
        """Estimate of the time that is left, for the user; empty as long as there is none."""
        return self._time_left.text

    @property
    def end_message(self) -> str:
        """What to tell the user about a job that was asked to end."""
        if self._reason:
            return Message("{job} was ended, nothing is written: {reason}", job=Message(self.name), reason=self._reason)
        return Message("{job} was canceled, nothing is written", job=Message(self.name))

    def _report(self, stage: str, share: float) -> None:
        """Called in the thread by the progress of the computation, which an error raised here ends."""
        self.stage, self.share = stage, share
        if self._ending.is_set():
            raise Canceled

    def _run(self) -> None:
        try:
            self._report(self.stage, self.share)
            self._compute(Progress(self._report))
        except BaseException as error:  # `result` raises it again in Blender's thread
            self._error = error


class JobHolder:
    """Holds the running job and why the last one ended; ends the job when Blender takes away its objects."""

    def __init__(self) -> None:
        self.job: BackgroundJob | None = None
        self._ended = PassingMessage()
        self._timer: Any = None
        self._handlers = (
            (bpy.app.handlers.load_pre, self._on_load),
            (bpy.app.handlers.undo_pre, self._on_undo),
            (bpy.app.handlers.redo_pre, self._on_undo),
        )
        for handlers, function in self._handlers:
            handlers.append(function)

    @property
    def message(self) -> str:
        """Why the last job ended early; empty if it did not, or if that is long ago."""
        return self._ended.text

    def start(self, name: str, compute: Callable[[Progress], None], check: Callable[[], None]) -> BackgroundJob:
        """Start a `BackgroundJob`; UserError if one is running."""
        if self.job is not None:
            raise UserError(JOB_RUNNING)
        self.job = BackgroundJob(name, compute, check)
        self._ended.show("")
        return self.job

    def start_timer(self, context: bpy.types.Context) -> None:
        """Let the window send timer events until the job is released."""
        self._timer = context.window_manager.event_timer_add(TIMER_INTERVAL, window=context.window)

    def release(self, message: str = "") -> None:
        """Release the job; one that still runs is asked to end. The panel shows the message for a while."""
        self._ended.show(message)
        if self.job is not None:
            self.job.end()
            self.job = None
        if self._timer is not None:
            bpy.context.window_manager.event_timer_remove(self._timer)
            self._timer = None

    def close(self) -> None:
        """End the job and remove the handlers, before the extension is disabled."""
        if self.job is not None:
            self.job.end(Message("the extension was disabled"))
            self.job.wait(EXIT_WAIT)
        self.release()
        for handlers, function in self._handlers:
            if function in handlers:
                handlers.remove(function)

    @persistent
    def _on_load(self, *_: Any) -> None:
        if self.job is not None:
            self.job.end(Message("another file was opened"))

    @persistent
    def _on_undo(self, *_: Any) -> None:
        if self.job is not None:
            self.job.end(Message("a step was undone or redone"))


def job_holder(context: bpy.types.Context) -> JobHolder:
    """The job holder of this Blender."""
    holder: JobHolder = getattr(context.window_manager, JOB_HOLDER)
    return holder
