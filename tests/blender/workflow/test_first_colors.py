"""First colors: a draft that is drawn while a job runs, and of which nothing is left when it ends."""

from types import SimpleNamespace

import bpy
import numpy as np
import pytest
from builders import changes, labels_of, scene_snapshot, snapshot
from running_jobs import APPLY, LEARN, OPS, RUNNING, TIMEOUT, finish_job, run
from test_job_window import drawn

from wks_segment.blender.workflow import pipeline
from wks_segment.blender.workflow.first_colors import first_colors_of
from wks_segment.blender.workflow.segmentation_job import SegmentationJob
from wks_segment.core import MemoryCache
from wks_segment.core.draft import segments
from wks_segment.core.progress import Progress

pytestmark = pytest.mark.usefixtures("scene")


@pytest.fixture
def drafts(monkeypatch):
    """Every job has a draft, however short it is."""
    monkeypatch.setattr(pipeline, "DRAFT_ABOVE", 0.0)


@pytest.fixture
def colors():
    return first_colors_of(bpy.context)


def test_colors_are_shown_and_nothing_is_written(poses, drafts, colors, hold_at):
    before = scene_snapshot()
    ran, go_on = hold_at("Signature")
    assert colors.shown
    n_triangles = sum(len(pose.data.polygons) for pose in poses)
    assert len(colors.preview.corners) == len(colors.preview.colors) == 3 * n_triangles
    assert {len(parts) for parts in ran.job.draft.values()} == {len(poses[0].data.polygons)}
    assert len(np.unique(colors.preview.colors.round(3), axis=0)) > 2
    assert not changes(before, scene_snapshot())
    text, _ = drawn()
    assert "First colors: provisional, nothing is written yet" in text.replace("\N{NO-BREAK SPACE}", " ")
    go_on()
    assert finish_job(ran) == {"FINISHED"}
    assert not colors.shown
    assert len(colors.preview.corners) == 0
    assert "provisional" not in drawn()[0]
    assert len(labels_of(poses[0])) == len(poses[0].data.polygons)


@pytest.mark.usefixtures("learns_anew")
def test_result_does_not_depend_on_the_draft(poses, monkeypatch):
    def labels(draft_above):
        monkeypatch.setattr(pipeline, "DRAFT_ABOVE", draft_above)
        job = SegmentationJob.learning(bpy.context, MemoryCache())
        job.drafts = True
        job.compute(Progress())
        return list(job.labels.values()), job.model.to_json(), bool(job.draft)

    with_draft, without = labels(0.0), labels(1e9)
    assert (with_draft[2], without[2]) == (True, False)
    assert with_draft[1] == without[1]
    np.testing.assert_array_equal(with_draft[0], without[0])


def test_one_undo_step(poses, drafts):
    bpy.ops.ed.undo_push(message="before")
    names = [pose.data.name for pose in poses]
    before = {name: snapshot(bpy.data.meshes[name]) for name in names}
    assert run(LEARN)[1] == {"FINISHED"}
    bpy.ops.ed.undo_push(message="Learn and Segment")
    assert bpy.ops.ed.undo() == {"FINISHED"}
    assert not changes(before, {name: snapshot(bpy.data.meshes[name]) for name in names})


@pytest.mark.usefixtures("learns_anew")
@pytest.mark.parametrize("labeled", [False, True])
def test_cancel_hides_colors_at_once_and_labels_stay(poses, settings, drafts, colors, hold_at, labeled):
    if labeled:
        OPS.learn()
        settings.n_segments, settings.n_eigenpairs = 3, 32
    before = scene_snapshot()
    ran, go_on = hold_at("Learning")
    assert colors.shown
    ran.modal(bpy.context, SimpleNamespace(type="ESC", value="PRESS"))
    assert ran.step(bpy.context) == RUNNING
    assert not colors.shown, "the thread has not ended yet"
    go_on()
    assert finish_job(ran) == {"CANCELLED"}
    assert not colors.shown
    assert not changes(before, scene_snapshot())


def test_saved_file_has_nothing_of_it(poses, drafts, colors, hold_at, tmp_path):
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "before.blend"))
    ran, go_on = hold_at("Signature")
    assert colors.shown
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "meanwhile.blend"), copy=True)
    found = []
    for name in ("before", "meanwhile"):
        bpy.ops.wm.open_mainfile(filepath=str(tmp_path / f"{name}.blend"))
        assert not colors.shown, "another file has been opened"
        found.append(scene_snapshot())
        go_on()
    assert not changes(*found)
    assert finish_job(ran) == {"CANCELLED"}


def test_colors_follow_what_moves(poses, drafts, colors, hold_at):
    ran, go_on = hold_at("Signature")
    places = colors.preview.corners.copy()
    poses[0].location.x += 5
    bpy.context.view_layer.update()
    assert ran.step(bpy.context) == RUNNING
    assert not colors.shown, "they would be where the object was"
    assert ran.step(bpy.context) == RUNNING
    assert colors.shown
    moved = (colors.preview.corners - places)[:, 0]
    n_own = 3 * len(poses[0].data.polygons)
    assert sorted(np.unique(moved.round(3))) == [0, 5]
    assert np.count_nonzero(moved > 1) == n_own
    for _ in range(3):  # showing them moves nothing
        assert ran.step(bpy.context) == RUNNING
        assert colors.shown
    bpy.context.scene.frame_set(7)
    assert ran.step(bpy.context) == RUNNING
    assert not colors.shown
    go_on()
    assert finish_job(ran) == {"FINISHED"}


@pytest.mark.parametrize("why", ["short", "no colors", "known"])
def test_no_draft_without_need(poses, settings, colors, monkeypatch, why):
    monkeypatch.setattr(pipeline, "DRAFT_ABOVE", 1e9 if why == "short" else 0.1)
    settings.write_colors = why != "no colors"
    if why == "known":
        OPS.learn()
    ran, result = run(LEARN)
    assert result == {"FINISHED"}
    assert ran.job.draft == {}


def test_scripts_and_apply_have_no_draft(poses, drafts, monkeypatch):
    monkeypatch.setattr(segments, "draft", lambda *_: pytest.fail("nobody would see it"))
    assert OPS.learn() == {"FINISHED"}
    ran, result = run(APPLY)
    assert result == {"FINISHED"}
    assert ran.job.draft == {}


def test_job_goes_on_without_a_draft(poses, drafts, colors, monkeypatch):
    monkeypatch.setattr(segments, "draft", lambda *_: None)
    ran, result = run(LEARN)
    assert result == {"FINISHED"}
    assert ran.job.draft == {}
    assert len(labels_of(poses[0])) == len(poses[0].data.polygons)


def test_proposed_segments_stay_in_view(walker, settings, session, drafts, colors, hold_at):
    settings.preview, settings.n_segments = True, 2
    session._due = 0.0
    session.on_timer()
    assert session.preview.shown
    session.cache.clear()
    ran, go_on = hold_at("Signature")
    assert ran.job.draft
    assert session.preview.shown
    assert not colors.shown
    go_on()
    finish_job(ran)


def test_closed_window_and_disabled_extension_hide_colors(poses, drafts, colors, hold_at, extension):
    ran, go_on = hold_at("Signature")
    assert colors.shown
    ran.cancel(bpy.context)
    assert not colors.shown
    go_on()
    ran.thread_job.wait(TIMEOUT)
    extension.unregister()
    try:
        for handlers in (bpy.app.handlers.depsgraph_update_post, bpy.app.handlers.frame_change_post):
            assert not [function for function in handlers if "wks_segment" in function.__module__]
    finally:
        extension.register()
