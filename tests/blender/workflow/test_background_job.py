"""Jobs in a thread, driven by the functions that the window's timer and events call: bpy alone has no window."""

import os
import subprocess
import sys
import threading
import time
import warnings
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import MagicMock

import bpy
import numpy as np
import pytest
from builders import changes, labels_of, limbed, limbed_poses, mesh_object, scene_snapshot, select, snapshot

from wks_segment.blender.errors import ChangedError, TooLargeError, UserError
from wks_segment.blender.operators import _report
from wks_segment.blender.operators._base import LabelOperator
from wks_segment.blender.operators.apply import WKS_SEGMENT_OT_apply
from wks_segment.blender.operators.learn import WKS_SEGMENT_OT_learn
from wks_segment.blender.ui import main_panel
from wks_segment.blender.workflow import background_job, live_session
from wks_segment.blender.workflow.background_job import JOB_RUNNING, BackgroundJob, TimeLeft, job_holder
from wks_segment.blender.workflow.segmentation_job import SegmentationJob
from wks_segment.core import MemoryCache
from wks_segment.core.progress import Progress

pytestmark = pytest.mark.usefixtures("scene")
OPS = bpy.ops.wks_segment
BENDS = (0.0, 0.3, 0.6)
LEARN, APPLY = WKS_SEGMENT_OT_learn, WKS_SEGMENT_OT_apply
GOING = {"PASS_THROUGH"}
STAGES = ["Starting", "Seams", "Signature", "Learning", "Labels", "Left and right", "Weights"]
LONG = 60
"""Seconds after which a test that hangs fails."""


class Ran:
    """What Blender makes of an operator's class: an operator that can be called, and keeps what it says."""

    def __new__(cls, operator, **properties):
        said = []
        own = {name: getattr(operator, name) for name in ("bl_label", "verb", "learns", "read")}
        report = {"report": lambda self, kinds, text: said.append((*kinds, text)), "said": said, "confirmed": False}
        plain = {"take": lambda self, settings: None, "is_adjusted": False}
        return type("Ran", (LabelOperator,), own | report | plain | properties)()


@pytest.fixture
def poses(settings):
    """Three objects in three poses, all of what can be written asked for."""
    settings.sides, settings.vertex_groups, settings.write_materials = "two", "soft", True
    made = limbed_poses(*BENDS)
    select(*made)
    return made


@pytest.fixture
def at(monkeypatch):
    """A function that holds the next job at a stage, and gives its operator and a function that lets it go on."""
    goes_on = threading.Event()

    def hold(stage, operator=LEARN, **properties):
        reached, original = threading.Event(), BackgroundJob._report

        def progress(self, now, share):
            if now.startswith(stage) and not reached.is_set():
                reached.set()
                assert goes_on.wait(LONG)
            original(self, now, share)

        monkeypatch.setattr(BackgroundJob, "_report", progress)
        ran = Ran(operator, **properties)
        ran.begin(bpy.context)
        assert reached.wait(LONG)
        assert ran.step(bpy.context) == GOING
        return ran, goes_on.set

    yield hold
    goes_on.set()


def ended(ran):
    """How the operator ends, once its job is over."""
    result, begun = GOING, time.monotonic()
    while result == GOING:
        assert time.monotonic() - begun < LONG
        time.sleep(0.01)
        result = ran.step(bpy.context)
    assert job_holder(bpy.context).job is None
    return result


def run(operator, **properties):
    """An operator whose job ran to its end, and how that was."""
    ran = Ran(operator, **properties)
    ran.begin(bpy.context)
    return ran, ended(ran)


# The result


@pytest.mark.usefixtures("learns_anew")
@pytest.mark.parametrize("sides", ["one", "two"])
def test_job_writes_what_a_script_gets(poses, settings, sides, tmp_path):
    settings.sides = sides
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "before.blend"))

    def after(learn, apply):
        bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "before.blend"))
        learn()
        learned = scene_snapshot()
        apply()
        found = {"learned": learned, "applied": scene_snapshot()}
        for snap in found.values():
            del snap["active"]
            snap["model"] = snap["model"][0]  # the summary names seconds
        return found

    scripted = after(OPS.learn, OPS.apply)
    ended_so = []
    threaded = after(lambda: ended_so.append(run(LEARN)), lambda: ended_so.append(run(APPLY)))
    assert scripted["learned"]["model"]
    assert not changes(scripted, threaded)
    assert [result for _, result in ended_so] == [{"FINISHED"}] * 2
    texts = [[text for kind, text in ran.said if kind == "INFO"][-1] for ran, _ in ended_so]
    assert texts[0].startswith("Learned: 3 poses, 1,926 vertices, 4 segments")
    assert texts[1].startswith("Applied: 3 poses, 1,926 vertices, 4 segments")


def test_undo_after_a_job_gives_back_what_was(poses):
    names = [pose.data.name for pose in poses]
    bpy.ops.ed.undo_push(message="before")
    before = {name: snapshot(bpy.data.meshes[name]) for name in names}
    assert run(LEARN)[1] == {"FINISHED"}
    bpy.ops.ed.undo_push(message="Learn and Segment")  # as Blender does when an operator with UNDO has finished
    assert "wks_segment" in bpy.data.meshes[names[0]].attributes
    assert bpy.ops.ed.undo() == {"FINISHED"}
    assert not changes(before, {name: snapshot(bpy.data.meshes[name]) for name in names})
    assert not bpy.context.scene.wks_segment.model
    assert bpy.ops.ed.redo() == {"FINISHED"}
    assert "wks_segment" in bpy.data.meshes[names[0]].attributes


def test_nothing_of_blender_is_needed_between_reading_and_writing(poses):
    job = SegmentationJob.learning(bpy.context, MemoryCache())
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    before = scene_snapshot()
    job.compute(Progress())
    with pytest.raises(ChangedError, match='the scene "Scene" was deleted'):
        job.write()
    assert not changes(before, scene_snapshot())


def test_settings_are_those_that_were_there_when_it_began(poses, settings, at):
    ran, go_on = at("Seams")
    settings.write_colors = settings.write_materials = False
    settings.vertex_groups, settings.n_segments = "none", 2
    go_on()
    assert ended(ran) == {"FINISHED"}
    assert poses[0].data.color_attributes.active_color_name == "wks_segment_color"
    assert len(poses[0].data.materials) > 2
    assert len(poses[0].vertex_groups) > 2


def test_model_goes_to_the_scene_that_it_was_learned_in(poses, settings, at):
    ran, go_on = at("Labels")
    other = bpy.data.scenes.new("Other")
    bpy.context.window.scene = other
    go_on()
    assert ended(ran) == {"FINISHED"}
    assert bpy.data.scenes["Scene"].wks_segment.model
    assert not other.wks_segment.model


def test_renamed_object_is_found(poses, at):
    ran, go_on = at("Learning")
    poses[0].name = "Another"
    go_on()
    assert ended(ran) == {"FINISHED"}
    assert len(labels_of(poses[0])) == 1280


def test_writing_waits_until_blender_can_undo_it(poses, at):
    other = limbed("Other")
    ran, go_on = at("Labels")
    select(other)
    bpy.ops.object.mode_set(mode="EDIT")
    go_on()
    ran.job.wait(LONG)
    for _ in range(3):
        assert ran.step(bpy.context) == GOING
    assert ran.job.stage == "Done, to be written in Object Mode"
    assert "wks_segment" not in poses[0].data.attributes
    bpy.ops.object.mode_set(mode="OBJECT")
    assert ended(ran) == {"FINISHED"}
    assert "wks_segment" in poses[0].data.attributes


# Cancel


@pytest.mark.usefixtures("learns_anew")
@pytest.mark.parametrize("stage", STAGES)
def test_escape_ends_it_at_every_stage_and_nothing_is_written(poses, at, stage):
    before = scene_snapshot()
    ran, go_on = at(stage)
    assert ran.modal(bpy.context, SimpleNamespace(type="MOUSEMOVE", value="NOTHING")) == GOING
    assert ran.modal(bpy.context, SimpleNamespace(type="ESC", value="PRESS")) == {"RUNNING_MODAL"}
    assert main_panel.job_texts(ran.job) == ("Canceling", "")
    go_on()
    assert ended(ran) == {"CANCELLED"}
    assert ran.said == [("WARNING", "Learn and Segment was canceled, nothing is written")]
    assert not changes(before, scene_snapshot())


@pytest.mark.parametrize("stage", ["Signature", "Labels", "Weights"])
def test_button_ends_applying(poses, at, stage):
    OPS.learn()
    before = scene_snapshot()
    ran, go_on = at(stage, APPLY)
    assert OPS.cancel() == {"FINISHED"}
    go_on()
    assert ended(ran) == {"CANCELLED"}
    assert ran.said == [("WARNING", "Apply to Selected was canceled, nothing is written")]
    assert not changes(before, scene_snapshot())


def test_button_is_gray_where_no_job_runs():
    assert not OPS.cancel.poll()
    with pytest.raises(RuntimeError, match="No job is running"):
        OPS.cancel()


def test_second_job_is_refused_and_the_first_goes_on(poses, at):
    ran, go_on = at("Signature")
    for operator in (OPS.learn, OPS.apply):
        bpy.context.scene.wks_segment.model = "something"
        assert not operator.poll()
        with pytest.raises(RuntimeError, match=JOB_RUNNING):
            operator()
    with pytest.raises(UserError, match=JOB_RUNNING):
        Ran(LEARN).begin(bpy.context)
    go_on()
    assert ended(ran) == {"FINISHED"}
    assert OPS.learn.poll()


# What ends it


def deleted():
    bpy.data.objects.remove(bpy.data.objects["Pose 1"])


def deleted_with_its_mesh():
    bpy.data.meshes.remove(bpy.data.meshes["Pose 1"])


def moved():
    bpy.data.meshes["Pose 1"].vertices[7].co.x += 1e-3


def turned():
    """A face with its corners the other way round, as many as before."""
    bpy.data.meshes["Pose 1"].flip_normals()


def grown():
    bpy.data.meshes["Pose 1"].vertices.add(1)


def exchanged():
    bpy.data.objects["Pose 1"].data = bpy.data.objects["Pose 1"].data.copy()


def edited():
    select(bpy.data.objects["Pose 1"])
    bpy.ops.object.mode_set(mode="EDIT")


def sculpted():
    select(bpy.data.objects["Pose 1"])
    bpy.ops.object.mode_set(mode="SCULPT")


def without_its_scene():
    bpy.context.window.scene = bpy.data.scenes.new("Other")
    bpy.data.scenes.remove(bpy.data.scenes["Scene"])


def opened():
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)


def undone():
    bpy.ops.ed.undo()


def redone():
    bpy.ops.ed.redo()


@pytest.mark.parametrize("stage", ["Signature", "Weights"])
@pytest.mark.parametrize(
    ("happens", "reason"),
    [
        (deleted, '"Pose 1" was deleted'),
        (deleted_with_its_mesh, '"Pose 1" was deleted'),
        (moved, 'the mesh of "Pose 1" was edited'),
        (turned, 'the mesh of "Pose 1" was edited'),
        (grown, 'the mesh of "Pose 1" was edited'),
        (exchanged, '"Pose 1" got another mesh'),
        (edited, '"Pose 1" went into Edit Mode'),
        (sculpted, '"Pose 1" went into Sculpt Mode'),
        (without_its_scene, 'the scene "Scene" was deleted'),
        (opened, "another file was opened"),
        (undone, "a step was undone or redone"),
        (redone, "a step was undone or redone"),
    ],
)
def test_what_takes_away_its_meshes_ends_it(poses, at, happens, reason, stage):
    bpy.ops.ed.undo_push(message="first")
    bpy.data.objects["Pose 2"].location.x = 3
    bpy.ops.ed.undo_push(message="moved")
    if happens is redone:
        undone()
    ran, go_on = at(stage)
    happens()
    after = scene_snapshot()
    assert ran.step(bpy.context) == GOING
    go_on()
    assert ended(ran) == {"CANCELLED"}
    message = f"Learn and Segment was ended, nothing is written: {reason}"
    assert ran.said == [("WARNING", message)]
    assert job_holder(bpy.context).message == message
    assert not changes(after, scene_snapshot())
    if bpy.context.mode != "OBJECT":
        bpy.ops.object.mode_set(mode="OBJECT")


@pytest.mark.usefixtures("learns_anew")
def test_blender_that_takes_the_window_away_ends_it(poses, at):
    before = scene_snapshot()
    ran, go_on = at("Learning")
    ran.cancel(bpy.context)
    assert job_holder(bpy.context).job is None
    assert "its window was closed" in job_holder(bpy.context).message
    go_on()
    ran.job.wait(LONG)
    assert not ran.job.succeeded
    assert not changes(before, scene_snapshot())
    assert OPS.learn() == {"FINISHED"}


@pytest.mark.usefixtures("learns_anew")
def test_extension_that_is_disabled_ends_it(poses, at, extension, monkeypatch):
    monkeypatch.setattr(background_job, "EXIT_WAIT", 0.1)
    meshes = {pose.name: snapshot(pose.data) for pose in poses}
    ran, go_on = at("Learning")
    extension.unregister()
    try:
        assert not changes(meshes, {pose.name: snapshot(pose.data) for pose in poses})
        go_on()
        ran.job.wait(LONG)
        with pytest.raises(UserError, match="the extension was disabled"):
            ran.job.result()
        for handlers in (bpy.app.handlers.load_pre, bpy.app.handlers.undo_pre, bpy.app.handlers.redo_pre):
            assert not [function for function in handlers if "wks_segment" in function.__module__]
    finally:
        extension.register()
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    assert not changes({}, {mesh.name: 1 for mesh in bpy.data.meshes})


def test_blender_that_is_quit_does_not_wait():
    code = """if True:
        import sys, threading
        import bpy
        import wks_segment.blender as extension
        from wks_segment.blender.workflow.background_job import job_holder
        extension.register()
        job = job_holder(bpy.context).start("Learn", lambda progress: threading.Event().wait(), lambda: None)
        extension.unregister()
        print("on the way out", flush=True)
    """
    root = Path(background_job.__file__).resolve().parents[3]
    # 4.2 ends with a crash, see conftest: that it ends is all.
    done = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        timeout=LONG,
        env=os.environ | {"PYTHONPATH": str(root)},
    )
    assert "on the way out" in done.stdout, done.stderr


# Errors


def test_error_in_the_thread_is_the_same_as_without_one(settings):
    select(limbed(), mesh_object([(0, 0, 0), (1, 0, 0), (1, 1e-7, 0)], [(0, 1, 2)], "Speck"))
    with pytest.raises(RuntimeError) as caught:
        OPS.learn()
    before = scene_snapshot()
    ran, result = run(LEARN)
    assert result == {"CANCELLED"}
    ((kind, text),) = ran.said
    assert (kind, text in str(caught.value)) == ("ERROR", True)
    assert text.startswith('"Speck": every face of the mesh collapses')
    assert not changes(before, scene_snapshot())
    assert OPS.learn.poll()


def test_defect_of_ours_is_no_silence(poses, monkeypatch):
    monkeypatch.setattr(SegmentationJob, "compute", lambda self, progress: 1 / 0)
    ran = Ran(LEARN)
    ran.begin(bpy.context)
    with pytest.raises(ZeroDivisionError):
        ended(ran)
    assert job_holder(bpy.context).job is None
    assert ran.modal(bpy.context, SimpleNamespace(type="TIMER", value="NOTHING")) == {"CANCELLED"}


def test_what_others_warn_of_meanwhile_is_theirs(poses, at):
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        ran, go_on = at("Signature")
        warnings.warn("of another extension", stacklevel=1)
        go_on()
        assert ended(ran) == {"FINISHED"}
    assert [str(warning.message) for warning in said] == ["of another extension"]
    assert not any("of another extension" in text for _, text in ran.said)


# The window


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


def test_button_starts_a_job_and_the_window_tells_the_time(poses, window):
    ran = Ran(LEARN)
    assert ran.invoke(window, None) == {"RUNNING_MODAL"}
    window.window_manager.event_timer_add.assert_called_once_with(background_job.TIMER_INTERVAL, window=window.window)
    window.window_manager.modal_handler_add.assert_called_once_with(ran)
    result, begun = GOING, time.monotonic()
    while result == GOING and time.monotonic() - begun < LONG:
        time.sleep(0.01)
        result = ran.modal(window, SimpleNamespace(type="TIMER", value="NOTHING"))
    assert result == {"FINISHED"}
    assert "wks_segment" in poses[0].data.attributes


def test_without_a_window_the_button_does_all_at_once(poses):
    assert bpy.app.background
    assert OPS.learn("INVOKE_DEFAULT") == {"FINISHED"}
    assert "wks_segment" in poses[0].data.attributes
    assert job_holder(bpy.context).job is None


def test_large_job_is_asked_about_and_then_runs(poses, settings, window):
    settings.limit_memory = 1e-6
    with pytest.raises(TooLargeError):
        Ran(LEARN).begin(window)
    ran = Ran(LEARN)
    assert ran.invoke(window, "event") == {"RUNNING_MODAL"}
    assert job_holder(bpy.context).job is None
    ((asked, event), options) = window.window_manager.invoke_confirm.call_args
    assert (asked, event) == (ran, "event")
    assert "allowed are 5.0 minutes and 0.0 GB" in options["message"]
    window.window_manager.modal_handler_add.assert_not_called()
    assert ran.execute(window) == {"RUNNING_MODAL"}
    window.window_manager.modal_handler_add.assert_called_once_with(ran)
    assert ended(ran) == {"FINISHED"}
    # From the panel that adjusts the last operation, it is a script's again.
    assert ran.execute(bpy.context) == {"FINISHED"}


def test_refusal_in_the_window_is_told(settings, window):
    settings.source = "SHAPE_KEYS"
    select(limbed())
    ran = Ran(LEARN)
    assert ran.invoke(window, None) == {"CANCELLED"}
    assert ran.said[0][0] == "ERROR"
    assert '"Limbed" has no shape keys' in ran.said[0][1]
    window.window_manager.modal_handler_add.assert_not_called()


# What is shown


def drawn():
    """The layout that the main panel was drawn on."""
    layout = MagicMock()
    cls = main_panel.WKS_SEGMENT_PT_main
    cls.draw(type("Shown", (cls.__bases__[0],), {"layout": layout})(), bpy.context)
    return layout.column.return_value


def test_panel_shows_how_far_it_is_and_why_it_ended(poses, at):
    assert not drawn().row.return_value.progress.called
    ran, go_on = at("Signature")
    job = job_holder(bpy.context).job
    job.stage, job.share = 'Signature of "Fox, frame 12" (3 of 5)', 0.375
    column = drawn()
    lines = [call.kwargs["text"] for call in column.label.call_args_list]
    assert " ".join(lines) == "Signature of Fox, frame 12 · 3\N{NO-BREAK SPACE}of\N{NO-BREAK SPACE}5"
    column.row.return_value.progress.assert_called_once_with(factor=0.375, text="38 %")
    assert column.row.return_value.operator.call_args.args == ("wks_segment.cancel",)
    OPS.cancel()
    go_on()
    ended(ran)
    column = drawn()
    lines = [call.kwargs["text"] for call in column.label.call_args_list]
    assert " ".join(lines) == "Learn and Segment was canceled, nothing is written"
    assert not column.row.return_value.progress.called


@pytest.mark.parametrize(
    ("told", "text"),
    [
        ([], ""),
        ([(1.0, 0.5)], ""),
        ([(10.0, 0.01)], ""),
        ([(10.0, 0.25)], "about 30 s left"),
        ([(30.0, 0.9)], "a few seconds left"),
        ([(60.0, 0.1)], "about 9 min left"),
        ([(10.0, 0.25), (10.1, 0.5)], "about 30 s left"),
        ([(10.0, 0.25)] + [(t, 0.5) for t in np.arange(10.1, 20, 0.1)], "about 15 s left"),
    ],
)
def test_time_left(told, text):
    left = TimeLeft()
    for seconds, share in told:
        left.update(seconds, share)
    assert left.text == text
