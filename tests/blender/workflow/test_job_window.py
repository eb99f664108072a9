"""Jobs started from a window: the question about a large job, and what the panel shows."""

import time
from types import SimpleNamespace
from unittest.mock import MagicMock

import bpy
import numpy as np
import pytest
from builders import limbed, select
from running_jobs import LEARN, OPS, RUNNING, TIMEOUT, CallableOperator, finish_job

from wks_segment.blender.errors import TooLargeError
from wks_segment.blender.operators import _report
from wks_segment.blender.ui import main_panel
from wks_segment.blender.workflow import background_job, live_session, passing_message
from wks_segment.blender.workflow.background_job import TimeLeft, job_holder

pytestmark = pytest.mark.usefixtures("scene")


class Window:
    """The context of a window: Blender's, but for what needs one."""

    def __init__(self):
        self.window = object()
        held = {
            holder: getattr(bpy.context.window_manager, holder)
            for holder in (background_job.JOB_HOLDER, live_session.SESSION)
        }
        self.window_manager = MagicMock(**held, windows=[])
        self.window_manager.event_timer_add.return_value = None
        self.window_manager.invoke_confirm.return_value = {"RUNNING_MODAL"}

    def __getattr__(self, name):
        return getattr(bpy.context, name)


@pytest.fixture
def window(monkeypatch):
    monkeypatch.setattr(_report, "has_window", lambda context: True)
    return Window()


def test_button_starts_a_job_with_a_timer(poses, window):
    ran = CallableOperator(LEARN)
    assert ran.invoke(window, None) == {"RUNNING_MODAL"}
    window.window_manager.event_timer_add.assert_called_once_with(background_job.TIMER_INTERVAL, window=window.window)
    window.window_manager.modal_handler_add.assert_called_once_with(ran)
    result, begun = RUNNING, time.monotonic()
    while result == RUNNING and time.monotonic() - begun < TIMEOUT:
        time.sleep(0.01)
        result = ran.modal(window, SimpleNamespace(type="TIMER", value="NOTHING"))
    assert result == {"FINISHED"}
    assert "wks_segment" in poses[0].data.attributes


def test_button_runs_at_once_without_a_window(poses):
    assert bpy.app.background
    assert OPS.learn("INVOKE_DEFAULT") == {"FINISHED"}
    assert "wks_segment" in poses[0].data.attributes
    assert job_holder(bpy.context).job is None


def test_large_job_runs_after_the_question(poses, settings, window):
    settings.limit_memory = 1e-6
    with pytest.raises(TooLargeError):
        CallableOperator(LEARN).start_thread(window)
    ran = CallableOperator(LEARN)
    assert ran.invoke(window, "event") == {"RUNNING_MODAL"}
    assert job_holder(bpy.context).job is None
    ((asked, event), options) = window.window_manager.invoke_confirm.call_args
    assert (asked, event) == (ran, "event")
    assert "allowed are 5.0 minutes and 0.0 GB" in options["message"]
    window.window_manager.modal_handler_add.assert_not_called()
    assert ran.execute(window) == {"RUNNING_MODAL"}
    window.window_manager.modal_handler_add.assert_called_once_with(ran)
    assert finish_job(ran) == {"FINISHED"}
    # From the panel that adjusts the last operation, it is a script's again.
    assert ran.execute(bpy.context) == {"FINISHED"}


def test_clear_is_gray_while_a_job_runs(poses, hold_at):
    select(*poses)
    assert OPS.learn() == {"FINISHED"}
    assert OPS.clear.poll()
    ran, go_on = hold_at("Segments")
    assert not OPS.clear.poll()
    with pytest.raises(RuntimeError, match="A job is running"):
        OPS.clear()
    go_on()
    finish_job(ran)
    assert OPS.clear() == {"FINISHED"}


def test_refusal_is_reported_in_the_window(settings, window):
    settings.source = "SHAPE_KEYS"
    select(limbed())
    ran = CallableOperator(LEARN)
    assert ran.invoke(window, None) == {"CANCELLED"}
    assert ran.reported[0][0] == "ERROR"
    assert '"Limbed" has no shape keys' in ran.reported[0][1]
    window.window_manager.modal_handler_add.assert_not_called()


def drawn():
    """What the place for messages shows: its texts as one, and the row of the progress bar."""
    layout = MagicMock()
    cls = main_panel.WKS_SEGMENT_PT_main
    shown = type("Shown", (cls.__bases__[0],), {"layout": layout})()
    shown.status(bpy.context)
    column = layout.column.return_value
    labels = [*column.row.return_value.label.call_args_list, *column.column.return_value.label.call_args_list]
    return " ".join(call.kwargs["text"] for call in labels).strip(), column.row.return_value


def test_panel_shows_progress_and_why_a_job_ended(poses, hold_at, monkeypatch):
    text, row = drawn()
    assert text == "No segments yet: learn a model, or apply one"
    assert not row.progress.called
    ran, go_on = hold_at("Signature")
    job = job_holder(bpy.context).job
    job.stage, job.share = 'Signature of "Fox, frame 12" (3 of 5)', 0.375
    text, row = drawn()
    assert text == "Signature of Fox, frame 12 ·\N{NO-BREAK SPACE}3\N{NO-BREAK SPACE}of\N{NO-BREAK SPACE}5"
    row.progress.assert_called_once_with(factor=0.375, text="38 %")
    assert row.operator.call_args.args == ("wks_segment.cancel",)
    OPS.cancel()
    go_on()
    finish_job(ran)
    text, row = drawn()
    assert text == "Learn and Segment was canceled, nothing is written"
    assert not row.progress.called
    begun = time.monotonic()
    monkeypatch.setattr(passing_message.time, "monotonic", lambda: begun + passing_message.MESSAGE_SECONDS + 1)
    assert drawn()[0] == "No segments yet: learn a model, or apply one", "the message has gone away"


@pytest.mark.parametrize(
    ("told", "text"),
    [
        ([], ""),
        ([(1.0, 0.5)], ""),
        ([(10.0, 0.01)], ""),
        ([(10.0, 0.25)], "about 30 s left"),
        ([(30.0, 0.9)], "a few seconds left"),
        ([(60.0, 0.1)], ""),
        ([(60.0, 0.19)], ""),
        ([(60.0, 0.2)], "about 4 min left"),
        # What was said earlier counts less, the further the work is.
        ([(10.0, 0.25), (10.1, 0.5)], "about 15 s left"),
        # While it stands the time runs down, but not out.
        ([(10.0, 0.25), (20.0, 0.25)], "about 30 s left"),
        ([(10.0, 0.25)] + [(t, 0.25) for t in np.arange(10.1, 42, 0.1)], "about 65 s left"),
    ],
)
def test_time_left(told, text):
    left = TimeLeft()
    for seconds, share in told:
        left.update(seconds, share)
    assert left.text == text
