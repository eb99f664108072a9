"""Poses from markers, pose libraries and caches: what is read, and that the scene is restored."""

import bpy
import numpy as np
import pytest
from builders import changes, labels_of, limbed, limbed_keys, limbed_rigged, scene_snapshot, select

from wks_segment.blender.errors import UserError
from wks_segment.blender.scene import poses as reader
from wks_segment.blender.scene.characters import Character
from wks_segment.blender.scene.pose_library import read_actions

pytestmark = pytest.mark.usefixtures("scene")
OPS = bpy.ops.wks_segment
QUICK = ("--eigenpairs", 30, "--energies", 40, "--segments", 4)


def marked(*frames):
    for frame in frames:
        bpy.context.scene.timeline_markers.new(f"Mark {frame}", frame=frame)


def height(pose):
    """How high a pose reaches."""
    return float(pose.mesh.vertices[:, 2].max())


def pose_action(armature, name, bend, asset=True, frames=(1,)):
    """An action that bends the limb by an angle at frames; it is in the file, and no object uses it."""
    data = armature.animation_data
    before, slot = data.action, getattr(data, "action_slot", None)
    pose = armature.pose.bones["limb"].rotation_euler.copy()
    data.action = action = bpy.data.actions.new(name)
    action.use_fake_user = True
    for i, frame in enumerate(frames):
        armature.pose.bones["limb"].rotation_euler = (bend if i == len(frames) // 2 else 0.0, 0, 0)
        armature.pose.bones["limb"].keyframe_insert("rotation_euler", frame=frame)
    data.action = before
    if slot is not None:
        data.action_slot = slot
    armature.pose.bones["limb"].rotation_euler = pose
    if asset:
        action.asset_mark()
    return action


@pytest.fixture
def library():
    """A rigged character with three pose assets, one longer action, and one of something else."""
    obj = limbed_rigged()
    armature = obj.parent
    for name, bend in (("Down", -0.8), ("Flat", 0.0), ("Up", 1.2)):
        pose_action(armature, name, bend)
    pose_action(armature, "Walk", 0.6, asset=False, frames=(10, 20, 30))
    other = limbed_keys(0.4, name="Other")
    other.data.shape_keys.key_blocks[1].keyframe_insert("value", frame=3)
    select(obj)
    return obj


# Markers


def test_markers_are_the_poses(settings):
    obj = limbed_rigged()
    marked(11, 1)
    (first, second) = reader.read_markers(bpy.context, Character((obj,)), 5)
    assert [first.name, second.name] == ["Walker, Mark 1", "Walker, Mark 11"]
    at_11 = reader.read_frames(bpy.context, Character((obj,)), [11])[0]
    np.testing.assert_array_equal(second.mesh.vertices, at_11.mesh.vertices)
    settings.source, settings.pose_count = "MARKERS", 5
    select(obj)
    bpy.context.scene.frame_set(7, subframe=0.25)
    before = scene_snapshot()
    assert OPS.learn() == {"FINISHED"}
    assert "2 poses" in settings.model_summary
    changed = changes(before, scene_snapshot())
    assert all(path.startswith(("/meshes/Walker/", "/model", "/segments")) for path in changed), changed


def test_the_number_of_markers_is_limited_evenly():
    obj = limbed_rigged()
    marked(*range(1, 22, 2), 5)
    names = [pose.name for pose in reader.read_markers(bpy.context, Character((obj,)), 3)]
    assert names == ["Walker, Mark 1", "Walker, Mark 11", "Walker, Mark 21"]


def test_missing_markers_are_named(settings):
    settings.source = "MARKERS"
    select(limbed_rigged())
    with pytest.raises(RuntimeError, match="no markers in the timeline"):
        OPS.learn()


# Pose library


def test_pose_assets_are_the_poses_each_from_rest(library, settings):
    poses = read_actions(bpy.context, Character((library,)), 5)
    assert [pose.name for pose in poses] == ["Walker, Down", "Walker, Flat", "Walker, Up"]
    flat = reader.read_frames(bpy.context, Character((library,)), [1])[0]
    np.testing.assert_allclose(poses[1].mesh.vertices, flat.mesh.vertices, atol=1e-5)
    assert not any(pose.is_like(other) for pose in poses for other in poses if pose is not other)


def test_without_assets_the_middles_of_actions_are_the_poses(library):
    for name in ("Down", "Flat", "Up"):
        bpy.data.actions.remove(bpy.data.actions[name])
    found = {pose.name: pose for pose in read_actions(bpy.context, Character((library,)), 5)}
    own = library.parent.animation_data.action.name
    assert sorted(found) == sorted(["Walker, Walk", f"Walker, {own}"])
    at_11 = reader.read_frames(bpy.context, Character((library,)), [11])[0]
    np.testing.assert_allclose(found[f"Walker, {own}"].mesh.vertices, at_11.mesh.vertices, atol=1e-5)


@pytest.mark.parametrize("moved_by", ["action", "nothing"])
def test_the_armature_is_restored(library, settings, moved_by):
    armature = library.parent
    if moved_by == "nothing":
        armature.animation_data.action = None
    bpy.context.scene.frame_set(7)
    # What is not keyed, and what is keyed but was changed since.
    armature.pose.bones["root"].rotation_quaternion = (0.9, 0.1, 0.3, 0.2)
    armature.pose.bones["root"]["mood"] = 3
    armature.pose.bones["limb"].rotation_euler = (0.111, 0.2, 0.3)
    armature.pose.bones["limb"].scale = (1, 1.25, 1)
    bpy.context.view_layer.update()
    before, seen = scene_snapshot(), reader.read_objects(bpy.context, [Character((library,))])[0]
    settings.source = "ACTIONS"
    assert OPS.learn() == {"FINISHED"}
    assert "3 poses" in settings.model_summary
    changed = changes(before, scene_snapshot())
    assert all(path.startswith(("/meshes/Walker/", "/model", "/segments")) for path in changed), changed
    assert armature.pose.bones["root"]["mood"] == 3
    after = reader.read_objects(bpy.context, [Character((library,))])[0]
    np.testing.assert_array_equal(after.mesh.vertices, seen.mesh.vertices)


def test_the_armature_is_restored_after_an_error(library, settings):
    library.data.vertices[3].co.x = float("nan")
    library.data.update()
    settings.source = "ACTIONS"
    before = scene_snapshot()
    with pytest.raises(RuntimeError, match="not finite"):
        OPS.learn()
    assert not changes(before, scene_snapshot())


def test_a_missing_pose_library_is_named(settings):
    settings.source = "ACTIONS"
    select(limbed())
    with pytest.raises(RuntimeError, match='"Limbed" has no armature'):
        OPS.learn()
    walker = limbed_rigged()
    walker.parent.animation_data_clear()
    for action in list(bpy.data.actions):
        bpy.data.actions.remove(action)
    with pytest.raises(UserError, match='no pose for "Rig"'):
        read_actions(bpy.context, Character((walker,)), 3)


# Caches


@pytest.mark.parametrize("suffix", [".abc", ".usdc"])
def test_frames_of_a_cache_are_poses(settings, tmp_path, suffix):
    obj = limbed_rigged()
    bpy.context.scene.frame_start, bpy.context.scene.frame_end = 1, 21
    expected = reader.read_frames(bpy.context, Character((obj,)), [4, 11, 18])
    path = str(tmp_path / f"walker{suffix}")
    if suffix == ".abc":
        bpy.ops.wm.alembic_export(filepath=path, start=1, end=21)
    else:
        bpy.ops.wm.usd_export(filepath=path, export_animation=True, export_armatures=False)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    if suffix == ".abc":
        bpy.ops.wm.alembic_import(filepath=path, as_background_job=False)
    else:
        bpy.ops.wm.usd_import(filepath=path)
    (cached,) = (found for found in bpy.data.objects if found.type == "MESH")
    assert [modifier.type for modifier in cached.modifiers] == ["MESH_SEQUENCE_CACHE"]
    settings = bpy.context.scene.wks_segment
    settings.n_segments, settings.n_eigenpairs, settings.n_energies = 4, 30, 40
    settings.source, settings.pose_count = "FRAMES", 3
    poses = reader.read_frames(bpy.context, Character((cached,)), [4, 11, 18])
    for pose, other in zip(poses, expected, strict=True):
        np.testing.assert_allclose(pose.mesh.vertices, other.mesh.vertices, atol=1e-4)
    select(cached)
    before = scene_snapshot()
    assert OPS.learn() == {"FINISHED"}
    assert "3 poses" in settings.model_summary
    assert len(np.unique(labels_of(cached))) > 1
    OPS.clear()
    assert [change for change in changes(before, scene_snapshot()) if not change.startswith("/model")] == []


@pytest.mark.parametrize("suffix", [".abc", ".usda", ".usdc"])
def test_caches_from_the_command_line(settings, command, tmp_path, suffix):
    limbed_rigged()
    bpy.context.scene.frame_start, bpy.context.scene.frame_end = 1, 21
    path, model = tmp_path / f"walker{suffix}", tmp_path / "model.json"
    if suffix == ".abc":
        bpy.ops.wm.alembic_export(filepath=str(path), start=1, end=21)
    else:
        bpy.ops.wm.usd_export(filepath=str(path), export_animation=True, export_armatures=False)
    done = command("learn", path, "--frames", 3, *QUICK, "--model", model, "--json")
    assert done.code == 0, done
    assert [pose["name"].split(", ")[1] for pose in done.result["poses"]] == ["frame 4", "frame 11", "frame 18"]
    assert not any("the same" in warning for warning in done.result["warnings"])


# Command line


def test_markers_and_actions_from_the_command_line(library, command, tmp_path):
    marked(1, 11)
    path = tmp_path / "library.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    for options, names in (
        (("--markers", 4), ["Walker, Mark 1", "Walker, Mark 11"]),
        (("--actions", 4), ["Walker, Down", "Walker, Flat", "Walker, Up"]),
    ):
        model = tmp_path / "model.json"
        done = command("learn", path, "--object", "Walker", *options, *QUICK, "--model", model, "--json")
        assert done.code == 0, done
        assert [pose["name"] for pose in done.result["poses"]] == names
    assert command("learn", path, "--markers", 2, "--frames", 2, "--model", model).code == 2
