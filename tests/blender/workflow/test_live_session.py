"""Labels follow the settings: the result is the same as after learning or applying again."""

import bpy
import numpy as np
import pytest
from builders import changes, labels_of, limbed_poses, limbed_rigged, select, snapshot
from live_settings import rest

from wks_segment.blender.workflow import live_session as module
from wks_segment.core import PoseSegmentation

pytestmark = pytest.mark.usefixtures("scene")
OPS = bpy.ops.wks_segment


def test_signatures_are_computed_once(walker, settings, fits):
    OPS.clear()
    settings.n_segments = 3
    assert OPS.learn() == {"FINISHED"}
    assert fits == {"fit": 1, "describe": 0}
    assert len(np.unique(labels_of(walker))) == 3


def test_moved_vertex_needs_new_signatures(walker, fits):
    walker.data.vertices[5].co.x += 0.01
    assert OPS.learn() == {"FINISHED"}
    assert fits == {"fit": 1, "describe": 2}


@pytest.mark.parametrize(("name", "value"), [("smoothness", 0.0), ("min_share", 20.0), ("n_segments", 3)])
def test_labels_follow_settings_and_equal_the_stored_models(walker, settings, session, fits, name, value):
    before = labels_of(walker)
    setattr(settings, name, value)
    np.testing.assert_array_equal(labels_of(walker), before)  # not while the user drags
    assert rest(session) is None
    follows = labels_of(walker)
    assert (follows != before).any()
    assert fits == {"fit": 0, "describe": 0}
    # The model that is stored now says the same by itself, on the same poses.
    stored = PoseSegmentation.from_json(settings.model)
    job = session.job
    again = stored.segment_polygons(
        [piece.pose for piece in job.described],
        [pose.polygon_of for pose in job.poses],
        settings.min_share / 100,
    )
    np.testing.assert_array_equal(follows, again)


def test_labels_follow_sides(session, settings, monkeypatch):
    from wks_segment.blender.cli import creature

    monkeypatch.setattr(creature, "SUBDIVISIONS", 1)
    obj = creature.build_creature(bpy.context.scene)
    select(obj)
    settings.source, settings.pose_count = "FRAMES", 2
    settings.n_segments, settings.n_eigenpairs = 5, 60
    assert OPS.learn() == {"FINISHED"}
    one = labels_of(obj)
    settings.sides = "two"
    rest(session)
    two = labels_of(obj)
    np.testing.assert_array_equal(two % 1000, one)
    assert {1, 2} <= set(two // 1000)
    settings.sides = "one"
    rest(session)
    np.testing.assert_array_equal(labels_of(obj), one)


def test_learned_number_of_segments_can_be_restored(walker, settings, session):
    before, model = labels_of(walker), settings.model
    for number in (2, 6, 4):
        settings.n_segments = number
        rest(session)
    np.testing.assert_array_equal(labels_of(walker), before)
    assert settings.model == model


def test_additional_segment_keeps_numbers_of_the_others(walker, settings, session):
    settings.n_segments = 2
    rest(session)
    before = labels_of(walker)
    settings.n_segments = 3
    rest(session)
    after = labels_of(walker)
    others = after != 2
    assert set(after) == {0, 1, 2}
    assert (after == before)[others].mean() > 0.9  # borders move a little


def test_changed_seed_changes_nothing(walker, settings, session):
    before = snapshot(walker.data)
    settings.random_state = 5
    rest(session)
    assert not changes(before, snapshot(walker.data))
    assert session.is_current(bpy.context.scene)


def test_applied_labels_and_model_follow(walker, settings, session, fits):
    other = limbed_poses(0.7)[0]
    select(other)
    assert OPS.apply() == {"FINISHED"}
    learned = labels_of(walker)
    settings.n_segments = 2
    rest(session)
    assert set(labels_of(other)) == {0, 1}
    np.testing.assert_array_equal(labels_of(walker), learned)
    assert PoseSegmentation.from_json(settings.model).n_segments_ == 2
    assert settings.model_summary.splitlines()[:2] == ["From Walker", "2 segments"]
    assert fits["fit"] == 0


def test_model_is_applied_with_the_number_in_the_field(walker, settings, session):
    settings.live, settings.n_segments = False, 2
    assert OPS.apply() == {"FINISHED"}
    assert set(labels_of(walker)) == {0, 1}
    settings.live, settings.smoothness = True, 1.5
    rest(session)
    assert set(labels_of(walker)) == {0, 1}
    assert settings.models[0].n_segments == 2


def test_all_objects_follow_when_objects_are_poses(session, settings):
    poses = limbed_poses(0.0, 0.5, 1.0)
    select(*poses)
    assert OPS.learn() == {"FINISHED"}
    settings.n_segments = 2
    rest(session)
    assert [set(labels_of(obj)) for obj in poses] == [{0, 1}] * 3


def test_other_outputs_follow(walker, settings, session):
    settings.vertex_groups, settings.write_materials = "soft", True
    assert OPS.learn() == {"FINISHED"}
    settings.n_segments = 3
    rest(session)
    names = [group.name for group in walker.vertex_groups if group.name.startswith("WKS")]
    assert names == ["WKS Segment 1", "WKS Segment 2", "WKS Segment 3"]
    assert len(walker.data.materials) == 3


def test_labels_do_not_follow_without_live_but_update_works(walker, settings, session):
    before = labels_of(walker)
    settings.live = False
    settings.n_segments = 2
    assert not bpy.app.timers.is_registered(session.timer)
    np.testing.assert_array_equal(labels_of(walker), before)
    assert OPS.update() == {"FINISHED"}
    assert set(labels_of(walker)) == {0, 1}


def test_slow_labels_do_not_follow_but_update_works(walker, settings, session, monkeypatch):
    session.job.report.seconds["label"] = 6.0
    settings.n_segments = 2
    assert not bpy.app.timers.is_registered(session.timer)
    assert OPS.update() == {"FINISHED"}
    assert set(labels_of(walker)) == {0, 1}


def test_timer_waits_until_settings_rest(walker, settings, session):
    settings.n_segments = 2
    assert bpy.app.timers.is_registered(session.timer)
    assert 0 < session.on_timer() <= module.QUIET_SECONDS
    assert labels_of(walker).max() == 3
    bpy.app.timers.unregister(session.timer)


def test_edited_mesh_is_not_written(walker, settings, session):
    walker.data.vertices[3].co.z += 0.1
    before = snapshot(walker.data)
    settings.n_segments = 2
    rest(session)
    assert not changes(before, snapshot(walker.data))
    assert 'the mesh of "Walker" was edited' in session.message
    assert session.job is None


def test_removed_object_has_nothing_to_follow(walker, settings, session):
    bpy.data.objects.remove(walker)
    settings.n_segments = 2
    assert not session.is_scheduled
    assert not OPS.update.poll()


def test_removed_pose_of_a_job_drops_the_job(session, settings):
    poses = limbed_poses(0.0, 0.5)
    select(*poses)
    OPS.learn()
    bpy.data.objects.remove(poses[1])
    settings.n_segments = 2
    rest(session)
    assert '"Pose 1" was deleted' in session.message
    assert session.job is None


def test_labels_do_not_follow_in_edit_mode(walker, settings, session):
    bpy.ops.object.mode_set(mode="EDIT")
    settings.n_segments = 2
    rest(session)
    bpy.ops.object.mode_set(mode="OBJECT")
    assert labels_of(walker).max() == 3
    assert OPS.update() == {"FINISHED"}
    assert set(labels_of(walker)) == {0, 1}


def test_labels_do_not_follow_after_clear(walker, settings, session):
    OPS.clear()
    before = snapshot(walker.data)
    settings.n_segments = 2
    rest(session)
    assert not changes(before, snapshot(walker.data))


def test_labels_follow_by_their_own_model_whichever_is_in_use(walker, settings, session, tmp_path):
    OPS.save_model(filepath=str(tmp_path / "model.json"))
    OPS.load_model(filepath=str(tmp_path / "model.json"))
    imported = settings.model
    settings.n_segments = 2
    rest(session)
    assert set(labels_of(walker)) == {0, 1}
    assert settings.model == imported
    assert [row.n_segments for row in settings.models] == [2, 4]


def test_opening_a_file_drops_the_job(walker, session, tmp_path):
    path = str(tmp_path / "kept.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    assert session.job is None
    bpy.context.scene.wks_segment.n_segments = 2
    rest(session)
    walker = bpy.data.objects["Walker"]
    assert labels_of(walker).max() == 3
    # One press of the button computes what Live needs.
    assert OPS.update() == {"FINISHED"}
    assert set(labels_of(walker)) == {0, 1}
    bpy.context.scene.wks_segment.n_segments = 4
    rest(session)
    assert labels_of(walker).max() == 3


def test_paper_method_keeps_its_number_of_segments(session, settings):
    obj = limbed_rigged()
    select(obj)
    settings.source, settings.pose_count, settings.preset = "FRAMES", 2, "paper"
    assert OPS.learn() == {"FINISHED"}
    before = labels_of(obj)
    settings.n_segments = 3
    rest(session)
    np.testing.assert_array_equal(labels_of(obj), before)
    assert "needs a new Learn and Segment" in session.message


def test_large_job_is_not_kept(session, settings, monkeypatch):
    monkeypatch.setattr(module, "MAX_KEPT_BYTES", 1000)
    obj = limbed_rigged()
    select(obj)
    settings.source, settings.pose_count = "FRAMES", 2
    assert OPS.learn() == {"FINISHED"}
    assert session.job is None
    settings.n_segments = 2
    assert not session.is_scheduled
    assert OPS.update() == {"FINISHED"}
    assert set(labels_of(obj)) == {0, 1}
