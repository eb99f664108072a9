"""`wks_segment segment`: poses that are read from files."""

import bpy
import numpy as np
import pytest
from builders import labels_of, limbed, limbed_keys, limbed_rigged, mesh_object, select
from command_files import QUICK, mesh_of_scene, save


def test_poses_from_frames_of_an_animation(command, folder, tmp_path):
    output = tmp_path / "out.blend"
    quick = "--eigenpairs", 60, "--energies", 30, "--segments", 4
    done = command("segment", folder / "walker.blend", "--frames", "1:21:3", *quick, "--output", output, "--json")
    assert done.code == 0, done
    assert [pose["name"] for pose in done.result["poses"]] == [f"Walker, frame {frame}" for frame in (1, 11, 21)]
    assert [pose["vertices"] for pose in done.result["poses"]] == [642] * 3
    assert done.result["segments"] == 4
    assert done.result["warnings"] == []
    assert done.result["files"] == {"output": str(output)}
    assert {"read", "signature", "mixture", "label", "write"} <= set(done.result["seconds"])
    bpy.ops.wm.open_mainfile(filepath=str(output))
    assert np.unique(labels_of(bpy.data.objects["Walker"])).tolist() == [0, 1, 2, 3]


def test_a_count_of_frames_is_spread_over_the_whole_animation(command, folder, tmp_path):
    done = command("segment", folder / "walker.blend", "--frames", 2, *QUICK, "--json")
    assert done.code == 0, done
    assert [pose["name"] for pose in done.result["poses"]] == ["Walker, frame 6", "Walker, frame 16"]


def test_frames_can_be_negative(command, folder):
    done = command("segment", folder / "walker.blend", "--frames=-10:-5:2", *QUICK, "--json")
    assert [pose["name"] for pose in done.result["poses"]] == ["Walker, frame -10", "Walker, frame -5"]


def test_poses_from_shape_keys(command, folder, tmp_path):
    output = tmp_path / "out.blend"
    done = command("segment", folder / "keyed.blend", "--shape-keys", 3, *QUICK, "--output", output, "--json")
    assert done.code == 0, done
    assert [pose["name"] for pose in done.result["poses"]] == ["Keyed, Basis", "Keyed, Bend 0.4", "Keyed, Bend 0.8"]
    bpy.ops.wm.open_mainfile(filepath=str(output))
    assert len(np.unique(labels_of(bpy.data.objects["Keyed"]))) > 1


@pytest.mark.parametrize("suffix", [".obj", ".ply", ".stl", ".blend"])
def test_each_of_several_files_is_a_pose(command, folder, tmp_path, suffix):
    files = [folder / f"pose_{i}{suffix}" for i in range(3)]
    output = tmp_path / "out.blend"
    done = command("segment", *files, *QUICK, "--output", output, "--json")
    assert done.code == 0, done
    assert len(done.result["poses"]) == 3
    assert {pose["vertices"] for pose in done.result["poses"]} == {642}
    assert done.result["warnings"] == []
    bpy.ops.wm.open_mainfile(filepath=str(output))
    labels = [labels_of(obj) for obj in bpy.data.objects if obj.type == "MESH"]
    assert len(labels) == 3
    assert min((labels[0] == other).mean() for other in labels) > 0.9


@pytest.mark.parametrize("suffix", [".glb", ".gltf", ".fbx"])
def test_poses_from_an_animated_file_of_another_format(command, folder, tmp_path, suffix):
    output = tmp_path / "out.blend"
    walker = folder / f"walker{suffix}"
    done = command("segment", walker, "--frames", 3, *QUICK, "--output", output, "--json")
    assert done.code == 0, done
    assert len(done.result["poses"]) == 3
    assert done.result["warnings"] == [], "the animation was not read"
    bpy.ops.wm.open_mainfile(filepath=str(output))
    assert len(np.unique(labels_of(mesh_of_scene()))) == 4


def test_without_frames_the_current_pose_is_used(command, folder):
    done = command("segment", folder / "walker.blend", *QUICK, "--json")
    assert [pose["name"] for pose in done.result["poses"]] == ["Walker"]
    assert "one pose only" in done.result["warnings"][0]


def test_object_option_selects_one_object(command, folder, tmp_path):
    limbed("First")
    limbed("Second", 0.5)
    path = save(tmp_path / "two.blend")
    assert len(command("segment", path, *QUICK, "--json").result["poses"]) == 2
    done = command("segment", path, "--object", "Second", *QUICK, "--json")
    assert [pose["name"] for pose in done.result["poses"]] == ["Second"]


def test_a_file_that_is_no_blend_file_has_one_character(command, tmp_path):
    limbed("First")
    mesh_object([(0, 0, 3), (1, 0, 3), (0, 1, 3)], [(0, 1, 2)], "Second")
    (pose,) = command("segment", save(tmp_path / "two.obj"), *QUICK, "--json").result["poses"]
    assert pose["vertices"] == 642 + 3


@pytest.mark.parametrize("reason", ["disabled", "in an excluded collection"])
def test_an_object_that_is_not_evaluated_is_no_pose(command, tmp_path, reason):
    """Blender would show it without modifiers and armature."""
    limbed("Seen")
    hidden = limbed("Hidden", 0.5)
    if reason == "disabled":
        hidden.hide_viewport = True
    else:
        scene, collection = bpy.context.scene, bpy.data.collections.new("Backup")
        scene.collection.children.link(collection)
        scene.collection.objects.unlink(hidden)
        collection.objects.link(hidden)
        bpy.context.view_layer.layer_collection.children["Backup"].exclude = True
    done = command("segment", save(tmp_path / "two.blend"), *QUICK, "--json")
    assert [pose["name"] for pose in done.result["poses"]] == ["Seen"]


def test_shape_keys_of_the_second_object_of_a_character_are_found(command, tmp_path):
    """A .glb file has one character, whose first object may have no shape keys."""
    keyed = limbed_keys(0.4, 0.8, name="B keyed")
    still = mesh_object([(0, 0, 3), (1, 0, 3), (0, 1, 3)], [(0, 1, 2)], "A still")
    select(still, keyed)
    done = command("segment", save(tmp_path / "two.glb"), "--shape-keys", 3, *QUICK, "--json")
    assert done.code == 0, done
    assert len(done.result["poses"]) == 3


def test_action_option_selects_an_action(command, tmp_path):
    obj = limbed_rigged(bends=((1, 0.0), (21, 0.8)))
    armature = obj.parent
    armature.animation_data.action.name = "Wave"
    armature.animation_data.action.use_fake_user = True
    armature.animation_data.action = None
    armature.keyframe_insert("location", frame=101)
    armature.keyframe_insert("location", frame=111)
    armature.animation_data.action.name = "Slide"
    path = save(tmp_path / "two.blend")
    done = command("segment", path, "--frames", 2, *QUICK, "--json", "--action", "Slide")
    assert [pose["name"] for pose in done.result["poses"]] == ["Walker, frame 104", "Walker, frame 108"]
    done = command("segment", path, "--frames", 2, *QUICK, "--json", "--action", "Wave")
    assert [pose["name"] for pose in done.result["poses"]] == ["Walker, frame 6", "Walker, frame 16"]
    assert done.result["warnings"] == [], "the action does not move the character"
