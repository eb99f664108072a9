"""Jobs: work in a thread, while the window lives on. One at a time; the desk holds it.

The thread knows no Blender. Blender's own thread looks after it: `Job.step` is what a timer calls.
"""

from __future__ import annotations

import re
import threading
import time
from collections.abc import Callable
from typing import Any

import bpy
from bpy.app.handlers import persistent

from ...core.poses.describe import Progress
from ..errors import ChangedError, EndedError, UserError
from ..ui.messages import in_panel

TICK = 0.1
"""Seconds between two looks at a job."""
SURE_AFTER, SURE_SHARE = 2.0, 0.03
"""Seconds and share of the work from which on the time left means something."""
SMOOTHING = 0.05
"""Weight of the newest estimate of the whole time among those before it."""
PATIENCE = 3.0
"""Seconds that Blender waits for a job when it is quit or the extension disabled."""
HOLDER = "wks_segment_desk"
"""Name of the desk at the type of Blender's window manager."""
BUSY = "A job is running: wait or cancel it"


class Canceled(Exception):  # noqa: N818  # no error, but the way out of the thread
    """Raised by the progress of a job that is to end."""


class TimeLeft:
    """From a share of the work that grows by leaps, the seconds that are left, smoothed."""

    def __init__(self) -> None:
        self._whole: float | None = None
        self._left: float | None = None

    def tell(self, seconds: float, share: float) -> None:
        """Say how much was done after how many seconds."""
        if seconds < SURE_AFTER or share < SURE_SHARE:
            return
        whole = seconds / share
        self._whole = whole if self._whole is None else self._whole + SMOOTHING * (whole - self._whole)
        self._left = max(self._whole - seconds, 0.0)

    def __str__(self) -> str:
        """As a person says it; empty as long as it is not known."""
        if self._left is None:
            return ""
        if self._left < 5:
            return "a few seconds left"
        if self._left < 90:
            return f"about {5 * round(self._left / 5)} s left"
        return f"about {round(self._left / 60)} min left"


class Job:
    """Work in a thread.

    Parameters
    ----------
    name : str
        As on the button.
    compute : callable
        The work, given a progress to call; must not touch Blender.
    check : callable
        Raises ChangedError when the work has become pointless; called in Blender's thread, many times a second.
    """

    def __init__(self, name: str, compute: Callable[[Progress], None], check: Callable[[], None]) -> None:
        self.name = name
        self.stage, self.share = "Starting", 0.0
        self._left = TimeLeft()
        self._compute, self._check = compute, check
        self._reason = ""
        self._ending = threading.Event()
        self._error: BaseException | None = None
        self._began = time.monotonic()
        # A daemon: Blender must not wait for it on its way out.
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    def step(self) -> bool:
        """Look at the work, from Blender's own thread; whether it is over, one way or another."""
        over = not self._thread.is_alive()
        if not self.ending:
            self._left.tell(time.monotonic() - self._began, self.share)
            try:
                self._check()
            except ChangedError as error:
                self.end(str(error))
        return over

    def end(self, reason: str = "") -> None:
        """Let it end as soon as it can: for a reason, or because the user wants it. The first one counts."""
        if not self.ending:
            self._reason = reason
            self._ending.set()

    def wait(self, seconds: float) -> None:
        """Until it is over, but no longer."""
        self._thread.join(seconds)

    def result(self) -> None:
        """Of work that is over, raise the error that ended it, if one did; EndedError if `end` was called."""
        if self.ending:
            raise EndedError(self.epitaph)
        if self._error is not None:
            raise self._error

    @property
    def ending(self) -> bool:
        """Whether it was told to end."""
        return self._ending.is_set()

    @property
    def succeeded(self) -> bool:
        """Whether it is over, and as it should."""
        return not (self._thread.is_alive() or self.ending or self._error)

    @property
    def epitaph(self) -> str:
        """How it was ended."""
        if self._reason:
            return f"{self.name} was ended, nothing is written: {self._reason}"
        return f"{self.name} was canceled, nothing is written"

    @property
    def lines(self) -> tuple[str, str]:
        """What it is at, and how far, for the panel: "Signature of Fox, frame 12 · 3 of 5" and "about 20 s left"."""
        if self.ending:
            return in_panel("Canceling"), in_panel(self._reason)
        stage = re.sub(r" \((\d+ \w+ \d+)\)$", r" · \1", in_panel(self.stage).replace('"', ""))
        return stage, in_panel(str(self._left)) or f"{100 * self.share:.0f} %"

    def _progress(self, stage: str, share: float) -> None:
        """Called in the thread."""
        self.stage, self.share = stage, share
        if self._ending.is_set():
            raise Canceled

    def _run(self) -> None:
        try:
            self._progress(self.stage, self.share)
            self._compute(self._progress)
        except BaseException as error:  # whatever it is, it is raised again where somebody sees it
            self._error = error


class Desk:
    """Where the one job lies, and why the last one was ended; ends the job when Blender takes away what it is about."""

    def __init__(self) -> None:
        self.job: Job | None = None
        self.said = ""
        self._timer: Any = None
        self._handlers = (
            (bpy.app.handlers.load_pre, self._on_load),
            (bpy.app.handlers.undo_pre, self._on_undo),
            (bpy.app.handlers.redo_pre, self._on_undo),
        )
        for handlers, function in self._handlers:
            handlers.append(function)

    def start(self, name: str, compute: Callable[[Progress], None], check: Callable[[], None]) -> Job:
        """Begin a `Job`; UserError if there is one."""
        if self.job is not None:
            raise UserError(BUSY)
        self.job, self.said = Job(name, compute, check), ""
        return self.job

    def tick(self, context: bpy.types.Context) -> None:
        """Let the window say ten times a second that time has passed, until the desk is cleared."""
        self._timer = context.window_manager.event_timer_add(TICK, window=context.window)

    def clear(self, said: str = "") -> None:
        """Take the job away; one that is not over ends by itself. What is said is shown until the next one."""
        self.said = said
        if self.job is not None:
            self.job.end()
            self.job = None
        if self._timer is not None:
            bpy.context.window_manager.event_timer_remove(self._timer)
            self._timer = None

    def close(self) -> None:
        """End the job, and hear no more of Blender."""
        if self.job is not None:
            self.job.end("the extension was disabled")
            self.job.wait(PATIENCE)
        self.clear()
        for handlers, function in self._handlers:
            if function in handlers:
                handlers.remove(function)

    @persistent
    def _on_load(self, *_: Any) -> None:
        if self.job is not None:
            self.job.end("another file was opened")

    @persistent
    def _on_undo(self, *_: Any) -> None:
        if self.job is not None:
            self.job.end("a step was undone or redone")


def desk_of(context: bpy.types.Context) -> Desk:
    """The desk of this Blender."""
    desk: Desk = getattr(context.window_manager, HOLDER)
    return desk


def redraw(context: bpy.types.Context) -> None:
    """Draw the sidebars anew, where the panel is."""
    for window in context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                for region in area.regions:
                    if region.type == "UI":
                        region.tag_redraw()
