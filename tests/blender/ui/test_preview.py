"""Segments that are shown and not written: nothing of the mesh changes until they are accepted."""

import bpy
import numpy as np
import pytest
from builders import changes, labels_of, limbed_rigged, scene_snapshot, select, snapshot

from wks_segment.blender.parts.palette import colors_of, linear
from wks_segment.blender.ui.preview import SHADES, SURFACE_OFFSET, preview_triangles
from wks_segment.blender.workflow.live_session import session_of

pytestmark = pytest.mark.usefixtures("scene")
OPS = bpy.ops.wks_segment


@pytest.fixture
def session(scene):
    found = session_of(bpy.context)
    found.drop()
    return found


@pytest.fixture
def walker(session, settings):
    """A character that was learned from two frames, and is previewed."""
    obj = limbed_rigged()
    select(obj)
    settings.source, settings.pose_count = "FRAMES", 2
    assert OPS.learn() == {"FINISHED"}
    settings.preview = True
    return obj


def rest(session):
    """What the timer does when the settings have rested."""
    session._due = 0.0
    if bpy.app.timers.is_registered(session.timer):
        bpy.app.timers.unregister(session.timer)
    assert session.on_timer() is None


def test_preview_is_not_written(walker, settings, session):
    before, model = snapshot(walker.data), settings.model
    settings.n_segments = 2
    rest(session)
    assert session.preview.shown
    assert len(session.preview.corners) == len(session.preview.colors) == 3 * len(walker.data.polygons)
    assert not changes(before, snapshot(walker.data))
    assert settings.model == model


def test_accept_writes_the_preview(walker, settings, session):
    settings.n_segments = 2
    rest(session)
    shown = next(iter(session.proposed[1].jobs[0].labels.values()))
    assert OPS.accept() == {"FINISHED"}
    np.testing.assert_array_equal(labels_of(walker), shown)
    assert set(shown) == {0, 1}
    assert not session.preview.shown
    assert len(session.preview.corners) == 0
    assert session.is_current(bpy.context.scene)
    assert not OPS.accept.poll()


def test_discard_restores_settings(walker, settings, session):
    before = snapshot(walker.data)
    settings.n_segments, settings.smoothness, settings.snap_to = 2, 2.0, {"sharp"}
    rest(session)
    assert OPS.discard() == {"FINISHED"}
    assert (settings.n_segments, settings.smoothness, settings.snap_to) == (4, 1.0, set())
    assert not session.preview.shown
    rest(session)
    assert not session.preview.shown
    assert not changes(before, snapshot(walker.data))
    assert not OPS.discard.poll()


def test_accept_can_be_undone(walker, settings, session):
    settings.n_segments = 2
    rest(session)
    bpy.ops.ed.undo_push(message="before")
    before = labels_of(walker)
    assert OPS.accept("EXEC_DEFAULT", True) == {"FINISHED"}
    bpy.ops.ed.undo()
    np.testing.assert_array_equal(labels_of(bpy.data.objects["Walker"]), before)


def test_undo_hides_the_preview(walker, settings, session):
    bpy.ops.ed.undo_push(message="before")
    settings.n_segments = 2
    rest(session)
    bpy.ops.ed.undo_push(message="after")
    bpy.ops.ed.undo()
    assert session.proposed is None
    assert not session.preview.shown


@pytest.mark.parametrize("how", ["learn", "load", "edit"])
def test_outdated_preview_is_hidden(walker, settings, session, how, tmp_path):
    settings.n_segments = 2
    rest(session)
    if how == "learn":
        OPS.learn()
    elif how == "load":
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    else:
        walker.data.vertices[0].co.x += 1
        before = scene_snapshot()
        with pytest.raises(RuntimeError, match="was edited"):
            OPS.accept()
        assert not changes(before, scene_snapshot())
    assert session.proposed is None
    assert not session.preview.shown


def test_preview_matches_the_evaluated_surface(walker, settings, session):
    """At another frame, through a modifier, a little above the surface, in the colors of the parts, shaded."""
    walker.modifiers.new("Fine", "SUBSURF").levels = 1
    bpy.context.scene.frame_set(11)
    job = session.job
    (character,) = {pose.character for pose in job.poses}
    labels = np.arange(len(walker.data.polygons)) % 3
    places, colors = preview_triangles(bpy.context, {character: labels}, {})
    evaluated = walker.evaluated_get(bpy.context.evaluated_depsgraph_get()).to_mesh()
    seen = np.array([vertex.co for vertex in evaluated.vertices])
    assert len(places) == 3 * 2 * 3 * len(walker.data.polygons)  # three quads for each triangle
    size = np.ptp(seen, axis=0).max()
    nearest = np.linalg.norm(places[::50, None] - seen, axis=2).min(axis=1)
    np.testing.assert_allclose(nearest, SURFACE_OFFSET * size, rtol=1e-3)
    assert (colors[:, 3] == 1).all()
    plain = linear(colors_of(np.repeat(labels, 18)))
    light = linear(colors[:, :3]).max(axis=1) / plain.max(axis=1)
    np.testing.assert_allclose(linear(colors[:, :3]), plain * light[:, None], atol=1e-6)
    assert SHADES[0] - 1e-6 <= light.min() < light.max() <= SHADES[1] + 1e-6


@pytest.mark.parametrize("smooth", [False, True])
def test_preview_is_as_smooth_as_the_mesh(walker, session, smooth):
    """The light differs between the corners of a face only where the mesh is shaded smooth."""
    walker.data.polygons.foreach_set("use_smooth", [smooth] * len(walker.data.polygons))
    (character,) = {pose.character for pose in session.job.poses}
    labels = np.zeros(len(walker.data.polygons), dtype=int)
    places, colors = preview_triangles(bpy.context, {character: labels}, {})
    differs = np.ptp(colors[:, 0].reshape(-1, 3), axis=1) > 1e-3
    assert differs.mean() > 0.5 if smooth else not differs.any()
    if smooth:
        # No seam between faces: a place has the same color in all of them.
        _, place = np.unique(np.round(places, 5), axis=0, return_inverse=True)
        order = np.argsort(place.ravel())
        same = np.diff(place.ravel()[order]) == 0
        assert np.abs(np.diff(colors[order, 0]))[same].max() < 1e-3


def test_preview_of_nothing_is_empty():
    places, colors = preview_triangles(bpy.context, {}, {})
    assert places.shape == (0, 3)
    assert colors.shape == (0, 4)
