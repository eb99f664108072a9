"""Learn and Segment, Apply to Selected and Clear: what they do and what they report."""

import bpy
import numpy as np
import pytest
from builders import (
    LIMBS,
    changes,
    labels_of,
    limbed,
    limbed_keys,
    limbed_poses,
    limbed_rigged,
    mesh_object,
    scene_snapshot,
    select,
    snapshot,
)

from wks_segment.blender import registration
from wks_segment.core.spectral import eigenpairs, multilevel

pytestmark = pytest.mark.usefixtures("scene")
OPS = bpy.ops.wks_segment
BENDS = (0.0, 0.3, 0.6)
UNSEEN = 0.6
"""Bend of a pose that is not learned."""


def agreement(first, second):
    return (labels_of(first) == labels_of(second)).mean()


def test_learn_from_objects_labels_all_alike(learned, settings):
    assert len(np.unique(labels_of(learned[0]))) == settings.n_segments
    assert min(agreement(learned[0], pose) for pose in learned) > 0.9
    assert all("wks_segment_color" in pose.data.color_attributes for pose in learned)
    assert not any(len(pose.data.materials) for pose in learned)


def test_the_limb_that_bends_and_the_body_are_different_segments(learned):
    points = np.array([polygon.center for polygon in learned[0].data.polygons])
    labels = labels_of(learned[0])
    tip = labels[np.argmax(points @ (LIMBS[0] / np.linalg.norm(LIMBS[0])))]
    assert tip != labels[np.argmin(np.linalg.norm(points, axis=1))]


def test_learn_from_frames_keeps_the_frame(settings):
    obj = limbed_rigged()
    settings.source, settings.pose_count = "FRAMES", 3
    select(obj)
    bpy.context.scene.frame_set(4, subframe=0.5)
    assert OPS.learn() == {"FINISHED"}
    assert len(np.unique(labels_of(obj))) > 1
    assert (bpy.context.scene.frame_current, bpy.context.scene.frame_subframe) == (4, 0.5)
    assert "Walker" in settings.model_summary
    assert "3 poses" in settings.model_summary


def test_learn_from_a_range_of_frames(settings, printed):
    select(limbed_rigged())
    settings.source, settings.pose_count, settings.use_frame_range = "FRAMES", 3, True
    settings.frame_first, settings.frame_last = 2, 3
    assert OPS.learn() == {"FINISHED"}
    assert "2 poses" in settings.model_summary


def test_learn_from_shape_keys_keeps_the_keys(settings):
    obj = limbed_keys(0.4, 0.8)
    obj.active_shape_key_index = 2
    settings.source = "SHAPE_KEYS"
    select(obj)
    assert OPS.learn() == {"FINISHED"}
    assert len(np.unique(labels_of(obj))) > 1
    assert obj.active_shape_key_index == 2
    assert "3 poses" in settings.model_summary


def test_objects_on_one_armature_are_labeled_as_one(settings):
    obj = limbed_rigged("Body")
    hat = mesh_object(
        [(0, 0, 1.5), (1, 0, 1.5), (0, 1, 1.5), (0, 0, 2)], [(0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3)], "Hat"
    )
    hat.parent = obj.parent
    select(obj, hat)
    assert OPS.learn() == {"FINISHED"}
    assert "Rig" in settings.model_summary
    assert "1 pose" in settings.model_summary
    assert len(labels_of(hat)) == 4


def test_two_objects_that_share_a_mesh_are_learned_from(settings):
    first = limbed()
    second = bpy.data.objects.new("Twin", first.data)
    bpy.context.scene.collection.objects.link(second)
    second.location.x = 8
    select(first, second)
    assert OPS.learn() == {"FINISHED"}
    assert len(np.unique(labels_of(first))) > 1
    OPS.clear()
    assert "wks_segment" not in first.data.attributes


def test_the_same_seed_gives_the_same_labels(learned):
    before = [labels_of(pose) for pose in learned]
    OPS.learn()
    np.testing.assert_array_equal(before, [labels_of(pose) for pose in learned])


def test_materials_are_written_only_if_asked_for(learned, settings):
    settings.write_materials, settings.write_colors = True, False
    OPS.learn()
    for pose in learned:
        assert len(pose.data.materials) == len(np.unique(labels_of(pose)))
        assert "wks_segment_color" not in pose.data.attributes


def test_learn_reports_facts(settings, printed):
    select(*limbed_poses(*BENDS))
    printed()
    OPS.learn()
    said = printed().out
    assert "Learned: 3 poses, 1,926 vertices, 4 segments, " in said
    assert "Warning" not in said


def test_one_pose_gives_a_warning(printed):
    select(limbed())
    printed()
    assert OPS.learn() == {"FINISHED"}
    assert "Warning: Learned from one pose only" in printed().out


def test_solver_warning_is_reported_once(settings, printed, monkeypatch):
    def refuse(*arguments):
        raise multilevel.NotConvergedError

    monkeypatch.setattr(eigenpairs, "multilevel_eigenpairs", refuse)
    monkeypatch.setattr(eigenpairs, "DENSE_BELOW", 0)
    select(*limbed_poses(*BENDS))
    printed()
    assert OPS.learn() == {"FINISHED"}
    assert printed().out.count("Warning: the fast eigensolver did not converge on this mesh") == 1


def test_equal_poses_give_a_warning(settings, printed):
    select(limbed())
    settings.source, settings.pose_count = "FRAMES", 3
    printed()
    assert OPS.learn() == {"FINISHED"}
    assert "poses are the same: does an animation move the character" in printed().out


def test_unseen_pose_gets_the_learned_labels(learned):
    unseen = limbed("Unseen", UNSEEN)
    select(unseen)
    assert OPS.apply() == {"FINISHED"}
    assert agreement(unseen, learned[1]) > 0.9


def test_apply_changes_only_selected_objects(learned, settings):
    unseen = limbed("Unseen", UNSEEN)
    select(unseen)
    before = scene_snapshot()
    OPS.apply()
    changed = changes(before, scene_snapshot())
    assert changed
    assert all(path.startswith("/meshes/Unseen/") or path == "/segments" for path in changed)


def test_apply_takes_a_finer_mesh(learned):
    finer = limbed("Finer", UNSEEN, subdivisions=5)
    select(finer)
    assert OPS.apply() == {"FINISHED"}
    own = np.array([polygon.center for polygon in learned[1].data.polygons])
    points = np.array([polygon.center for polygon in finer.data.polygons])
    nearest = np.linalg.norm(points[:, None] - own[None], axis=2).argmin(axis=1)
    assert (labels_of(finer) == labels_of(learned[1])[nearest]).mean() > 0.8


def test_apply_takes_a_turned_scaled_and_mirrored_object(learned):
    twin = limbed("Twin", BENDS[1])
    twin.scale, twin.rotation_euler, twin.location = (-3, 3, 3), (1, 2, 3), (4, 5, 6)
    select(twin)
    OPS.apply()
    assert agreement(twin, learned[1]) > 0.95


def test_clear_restores_everything(settings):
    poses = limbed_poses(*BENDS)
    poses[0].data.materials.append(bpy.data.materials.new("Skin"))
    settings.write_materials = True
    select(*poses)
    before = scene_snapshot()
    del before["model"]
    OPS.learn()
    assert OPS.clear() == {"FINISHED"}
    assert [path for path in changes(before, scene_snapshot()) if path != "/model"] == []
    assert [material.name for material in bpy.data.materials] == ["Skin"]


def test_clear_touches_only_what_is_selected(learned):
    select(learned[0])
    OPS.clear()
    assert "wks_segment" not in learned[0].data.attributes
    assert "wks_segment" in learned[1].data.attributes


def test_operators_register_undo():
    for name in ("learn", "apply", "clear", "load_model"):
        cls = getattr(registration, f"WKS_SEGMENT_OT_{name}")
        assert {"REGISTER", "UNDO"} <= cls.bl_options, name


def test_undo_restores_everything():
    select(limbed())
    bpy.ops.ed.undo_push(message="before")
    before = snapshot(bpy.data.meshes["Limbed"])
    OPS.learn()
    bpy.ops.ed.undo_push(message="learned")
    assert "wks_segment" in bpy.data.meshes["Limbed"].attributes
    assert bpy.ops.ed.undo() == {"FINISHED"}
    assert not changes(before, snapshot(bpy.data.meshes["Limbed"]))
    assert not bpy.context.scene.wks_segment.model
    assert bpy.ops.ed.redo() == {"FINISHED"}
    assert "wks_segment" in bpy.data.meshes["Limbed"].attributes
    assert bpy.context.scene.wks_segment.model
