"""The command line: what it reads, learns, writes and prints, and how it fails."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import bpy
import numpy as np
import pytest
from builders import Outcome, labels_of, limbed, limbed_keys, limbed_rigged, mesh_object, numbers, select

from wks_segment.blender.parts.palette import palette
from wks_segment.core import PoseSegmentation

ROOT = Path(__file__).resolve().parents[3]
QUICK = ("--eigenpairs", 30, "--energies", 40, "--segments", 4)
BENDS = (0.0, 0.3, 0.6)


def empty():
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)


def save(path):
    """Write the current scene, in the format that the name ends in."""
    name = str(path)
    if path.suffix == ".blend":
        bpy.ops.wm.save_as_mainfile(filepath=name, copy=True)
    elif path.suffix == ".glb":
        bpy.ops.export_scene.gltf(filepath=name)
    elif path.suffix == ".gltf":
        bpy.ops.export_scene.gltf(filepath=name, export_format="GLTF_SEPARATE")
    elif path.suffix == ".fbx":
        bpy.ops.export_scene.fbx(filepath=name)
    else:
        getattr(bpy.ops.wm, f"{path.suffix[1:]}_export")(filepath=name)
    return path


@pytest.fixture(scope="module")
def folder(extension, tmp_path_factory):
    """Files of the test character: an animated one, one with shape keys, and three poses in each static format."""
    folder = tmp_path_factory.mktemp("characters")
    empty()
    limbed_rigged()
    for suffix in (".blend", ".glb", ".gltf", ".fbx"):
        save(folder / f"walker{suffix}")
    empty()
    limbed_keys(0.4, 0.8)
    save(folder / "keyed.blend")
    for i, bend in enumerate(BENDS):
        empty()
        limbed(f"Pose {i}", bend)
        for suffix in (".obj", ".ply", ".stl", ".blend"):
            save(folder / f"pose_{i}{suffix}")
    empty()
    return folder


def mesh_of_scene():
    (obj,) = [obj for obj in bpy.context.scene.objects if obj.type == "MESH" and not obj.name.startswith("Ico")]
    return obj


# segment


def test_segment_frames_of_an_animation(command, folder, tmp_path):
    output = tmp_path / "out.blend"
    done = command("segment", folder / "walker.blend", "--frames", "1:21:3", *QUICK, "--output", output, "--json")
    assert done.code == 0, done
    assert [pose["name"] for pose in done.result["poses"]] == [f"Walker, frame {frame}" for frame in (1, 11, 21)]
    assert [pose["vertices"] for pose in done.result["poses"]] == [642] * 3
    assert done.result["segments"] == 4
    assert done.result["warnings"] == []
    assert done.result["files"] == {"output": str(output)}
    assert {"read", "signature", "mixture", "label", "write"} <= set(done.result["seconds"])
    bpy.ops.wm.open_mainfile(filepath=str(output))
    assert np.unique(labels_of(bpy.data.objects["Walker"])).tolist() == [0, 1, 2, 3]


def test_count_alone_spreads_over_the_own_animation(command, folder, tmp_path):
    done = command("segment", folder / "walker.blend", "--frames", 2, *QUICK, "--json")
    assert done.code == 0, done
    assert [pose["name"] for pose in done.result["poses"]] == ["Walker, frame 6", "Walker, frame 16"]


def test_negative_frames_are_frames(command, folder):
    done = command("segment", folder / "walker.blend", "--frames=-10:-5:2", *QUICK, "--json")
    assert [pose["name"] for pose in done.result["poses"]] == ["Walker, frame -10", "Walker, frame -5"]


def test_segment_shape_keys(command, folder, tmp_path):
    output = tmp_path / "out.blend"
    done = command("segment", folder / "keyed.blend", "--shape-keys", 3, *QUICK, "--output", output, "--json")
    assert done.code == 0, done
    assert [pose["name"] for pose in done.result["poses"]] == ["Keyed, Basis", "Keyed, Bend 0.4", "Keyed, Bend 0.8"]
    bpy.ops.wm.open_mainfile(filepath=str(output))
    assert len(np.unique(labels_of(bpy.data.objects["Keyed"]))) > 1


@pytest.mark.parametrize("suffix", [".obj", ".ply", ".stl", ".blend"])
def test_segment_several_files_each_a_pose(command, folder, tmp_path, suffix):
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
def test_segment_an_animated_file_of_another_format(command, folder, tmp_path, suffix):
    output = tmp_path / "out.blend"
    walker = folder / f"walker{suffix}"
    done = command("segment", walker, "--frames", 3, *QUICK, "--output", output, "--json")
    assert done.code == 0, done
    assert len(done.result["poses"]) == 3
    assert done.result["warnings"] == [], "the animation did not come along"
    bpy.ops.wm.open_mainfile(filepath=str(output))
    assert len(np.unique(labels_of(mesh_of_scene()))) == 4


def test_a_character_without_frames_is_taken_as_it_is(command, folder):
    done = command("segment", folder / "walker.blend", *QUICK, "--json")
    assert [pose["name"] for pose in done.result["poses"]] == ["Walker"]
    assert "one pose only" in done.result["warnings"][0]


def test_object_option_takes_the_named_object_only(command, folder, tmp_path):
    limbed("First")
    limbed("Second", 0.5)
    path = save(tmp_path / "two.blend")
    assert len(command("segment", path, *QUICK, "--json").result["poses"]) == 2
    done = command("segment", path, "--object", "Second", *QUICK, "--json")
    assert [pose["name"] for pose in done.result["poses"]] == ["Second"]


def test_file_of_another_format_than_blend_holds_one_character(command, tmp_path):
    limbed("First")
    mesh_object([(0, 0, 3), (1, 0, 3), (0, 1, 3)], [(0, 1, 2)], "Second")
    (pose,) = command("segment", save(tmp_path / "two.obj"), *QUICK, "--json").result["poses"]
    assert pose["vertices"] == 642 + 3


@pytest.mark.parametrize("how", ["disabled", "in a collection that is excluded"])
def test_object_that_is_not_seen_is_no_pose(command, tmp_path, how):
    """Blender does not evaluate it: neither its modifiers nor its armature would take part."""
    limbed("Seen")
    hidden = limbed("Hidden", 0.5)
    if how == "disabled":
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
    """A file of any format but .blend holds one character, whose first object may have no shape keys."""
    keyed = limbed_keys(0.4, 0.8, name="B keyed")
    still = mesh_object([(0, 0, 3), (1, 0, 3), (0, 1, 3)], [(0, 1, 2)], "A still")
    select(still, keyed)
    done = command("segment", save(tmp_path / "two.glb"), "--shape-keys", 3, *QUICK, "--json")
    assert done.code == 0, done
    assert len(done.result["poses"]) == 3


def test_action_option_chooses_among_several(command, tmp_path):
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


def test_materials_are_written_if_asked_for(command, folder, tmp_path):
    output = tmp_path / "out.blend"
    command("segment", folder / "pose_0.obj", *QUICK, "--materials", "--output", output)
    bpy.ops.wm.open_mainfile(filepath=str(output))
    names = [material.name for material in mesh_of_scene().data.materials]
    assert names == ["Segment 1", "Segment 2", "Segment 3", "Segment 4"]


# Outputs


def test_blend_output_keeps_the_model(command, folder, tmp_path):
    output = tmp_path / "out.blend"
    assert command("segment", folder / "pose_0.obj", *QUICK, "--output", output).code == 0
    bpy.ops.wm.open_mainfile(filepath=str(output))
    obj = mesh_of_scene()
    labels = labels_of(obj)
    select(obj)
    assert bpy.ops.wks_segment.apply() == {"FINISHED"}
    assert (labels_of(obj) == labels).mean() > 0.95


def test_blend_output_keeps_what_was_in_the_file(command, folder, tmp_path):
    output = tmp_path / "out.blend"
    command("segment", folder / "walker.blend", "--frames", "1:21:3", *QUICK, "--output", output)
    bpy.ops.wm.open_mainfile(filepath=str(output))
    walker = bpy.data.objects["Walker"]
    assert walker.parent.animation_data.action is not None
    assert [group.name for group in walker.vertex_groups] == ["root", "limb"]
    assert len(bpy.data.scenes) == 1


def test_input_file_may_be_the_output(command, folder, tmp_path):
    limbed("Own")
    path = save(tmp_path / "own.blend")
    assert command("segment", path, *QUICK, "--output", path).code == 0
    bpy.ops.wm.open_mainfile(filepath=str(path))
    assert len(np.unique(labels_of(bpy.data.objects["Own"]))) == 4


def palette_distance(colors):
    """(n,) largest difference of each sRGB color to the nearest of the first four of the palette."""
    return np.abs(colors[:, None] - palette()[None, :4]).max(axis=2).min(axis=1)


def srgb(linear):
    return np.where(linear < 0.0031308, 12.92 * linear, 1.055 * np.maximum(linear, 1e-9) ** (1 / 2.4) - 0.055)


@pytest.mark.parametrize("suffix", [".glb", ".obj"])
def test_colors_are_in_the_output(command, folder, tmp_path, suffix):
    output = tmp_path / f"out{suffix}"
    assert command("segment", folder / "pose_0.obj", *QUICK, "--output", output).code == 0
    empty()
    if suffix == ".glb":
        bpy.ops.import_scene.gltf(filepath=str(output))
    else:
        bpy.ops.wm.obj_import(filepath=str(output))
    mesh = mesh_of_scene().data
    assert len(mesh.color_attributes) == 1
    colors = srgb(numbers(mesh, mesh.color_attributes[0].name, "color", 4)[:, :3])
    near = palette_distance(colors) < 0.02
    # An .obj file has colors at vertices only, which blend along borders.
    assert near.mean() > (0.99 if suffix == ".glb" else 0.6)
    used = np.abs(colors[near][:, None] - palette()[None, :4]).max(axis=2).argmin(axis=1)
    assert len(np.unique(used)) == 4


def test_animation_is_in_the_glb_output(command, folder, tmp_path):
    output = tmp_path / "out.glb"
    assert command("segment", folder / "walker.glb", "--frames", 2, *QUICK, "--output", output).code == 0
    done = command("segment", output, "--frames", 3, *QUICK, "--json")
    assert done.code == 0, done
    assert done.result["warnings"] == []


def test_picture_is_written(command, folder, tmp_path, needs_rendering):
    picture = tmp_path / "out.png"
    done = command("segment", folder / "pose_0.obj", folder / "pose_2.obj", *QUICK, "--render", picture, "--json")
    assert done.code == 0, done
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert done.result["files"] == {"render": str(picture)}
    assert done.result["seconds"]["render"] > 0


def test_text_output_is_a_table_for_a_person(command, folder):
    done = command("segment", folder / "pose_0.obj", *QUICK)
    assert done.code == 0, done
    lines = done.out.splitlines()
    assert lines[0].split() == ["pose", "vertices"]
    assert "642" in lines[2]
    assert any(line == "4 segments" for line in lines)
    assert any(line.startswith("warning: Learned from one pose only") for line in lines)


@pytest.mark.parametrize("name", ["segment", "learn"])
def test_number_of_segments_may_be_automatic(command, folder, tmp_path, name):
    model = tmp_path / "model.json"
    done = command(name, folder / "pose_0.obj", *QUICK, "--segments", "auto", "--model", model, "--json")
    assert done.code == 0, done
    curve = PoseSegmentation.load(model).grouping_.curve()
    assert done.result["certainty"] == {str(i): round(curve[i - 1], 3) for i in range(2, 17)}
    assert 2 <= done.result["segments"] <= 16
    (note,) = done.result["notes"]
    assert f"({PoseSegmentation.load(model).n_segments_} taken)" in note
    assert note in command(name, folder / "pose_0.obj", *QUICK, "--segments", "auto", "--model", model).out


def test_certainty_is_told_of_a_number_that_was_given_but_not_of_the_paper(command, folder):
    given = command("segment", folder / "pose_0.obj", *QUICK, "--json").result
    assert len(given["certainty"]) == 15
    assert given["notes"] == []
    assert "certainty" not in command("segment", folder / "pose_0.obj", *QUICK, "--preset", "paper", "--json").result


def test_automatic_number_with_the_papers_setting(command, folder):
    done = command("segment", folder / "pose_0.obj", *QUICK, "--segments", "auto", "--preset", "paper")
    fails(done, "cannot be automatic with the method of the paper")


def test_marks_to_snap_to_reach_the_settings(command, folder, tmp_path):
    output = tmp_path / "out.blend"
    done = command("segment", folder / "pose_0.obj", *QUICK, "--snap-to", "seams,sharp", "--output", output)
    assert done.code == 0, done
    assert bpy.context.scene.wks_segment.snap_to == {"seams", "sharp"}


def test_progress_goes_to_standard_error(command, folder):
    done = command("segment", folder / "pose_0.obj", *QUICK, "--json")
    assert "Signature of" in done.err
    assert "%" in done.err


# learn, apply


@pytest.fixture
def model(command, folder, tmp_path):
    """A model file, learned from three files."""
    path = tmp_path / "model.json"
    done = command("learn", *(folder / f"pose_{i}.obj" for i in range(3)), *QUICK, "--model", path, "--json")
    assert done.code == 0, done
    assert done.result["files"] == {"model": str(path)}
    return path


def test_learned_model_can_be_loaded_by_the_core(model):
    loaded = PoseSegmentation.load(model)
    assert (loaded.n_segments, loaded.n_eigenpairs, loaded.n_energies) == (4, 30, 40)


def test_segment_and_learn_give_the_same_model(command, folder, model, tmp_path):
    other = tmp_path / "other.json"
    command("segment", *(folder / f"pose_{i}.obj" for i in range(3)), *QUICK, "--model", other)
    assert json.loads(other.read_text()) == json.loads(model.read_text())


def test_apply_gives_an_unseen_pose_the_labels_of_the_training(command, folder, model, tmp_path):
    empty()
    limbed("Unseen", 0.6)
    unseen = save(tmp_path / "unseen.ply")
    labels = {}
    for name, path in (("known", folder / "pose_1.obj"), ("unseen", unseen)):
        output = tmp_path / f"{name}.blend"
        done = command("apply", path, "--model", model, "--output", output, "--json")
        assert done.code == 0, done
        assert done.result["segments"] == 4
        bpy.ops.wm.open_mainfile(filepath=str(output))
        labels[name] = labels_of(mesh_of_scene())
    # Importers turn axes and number faces as the file does; both files hold the faces in the same order.
    assert (labels["known"] == labels["unseen"]).mean() > 0.9


def test_apply_takes_frames(command, folder, model, tmp_path):
    done = command(
        "apply", folder / "walker.glb", "--frames", 2, "--model", model, "--output", tmp_path / "out.glb", "--json"
    )
    assert done.code == 0, done
    assert len(done.result["poses"]) == 2


# Wrong usage: exit code 2


@pytest.mark.parametrize(
    "arguments",
    [
        (),
        ("frobnicate",),
        ("segment",),
        ("learn", "{pose}"),
        ("apply", "{pose}"),
        ("segment", "{pose}", "--segments", "1"),
        ("segment", "{pose}", "--segments", "65"),
        ("segment", "{pose}", "--segments", "many"),
        ("learn", "{pose}", "--model", "model.json", "--segments", "Auto"),
        ("segment", "{pose}", "--snap-to", "creases"),
        ("segment", "{pose}", "--snap-to", ""),
        ("learn", "{pose}", "--model", "model.json", "--snap-to", "sharp"),
        ("segment", "{pose}", "--eigenpairs", "19"),
        ("segment", "{pose}", "--smallest-part", "nan"),
        ("segment", "{pose}", "--covariance", "round"),
        ("segment", "{pose}", "--frames", "1:10"),
        ("segment", "{pose}", "--frames", "10:1:3"),
        ("segment", "{pose}", "--frames", "1:10:0"),
        ("segment", "{pose}", "--frames", "a:b:c"),
        ("segment", "{pose}", "--frames", "3", "--shape-keys", "3"),
        ("segment", "{pose}", "--shape-keys", "0"),
        ("segment", "{pose}", "--shape-keys", "-2"),
    ],
    ids=" ".join,
)
def test_wrong_usage_is_told_with_exit_code_2(command, folder, arguments):
    done = command(*(argument.format(pose=folder / "pose_0.obj") for argument in arguments))
    assert done.code == 2, done
    assert "wks_segment" in done.err
    assert not done.out


def test_help_is_printed(command):
    done = command("segment", "--help")
    assert done.code == 0
    for word in ("FIRST:LAST:COUNT", "--segments", "default: 8", "--json"):
        assert word in done.out


# Failure: exit code 1, with the reason


def fails(done, *words):
    """The command failed as it should, and said why: exit code 1, no traceback, these words."""
    assert done.code == 1, done
    _, found, message = ("\n" + done.err).partition("\nwks_segment: ")  # before it, what importers print
    assert found, done
    assert "Traceback" not in message, done
    for word in words:
        assert str(word) in message, done


def test_failure_with_json_is_one_object(command, tmp_path):
    done = command("segment", tmp_path / "missing.obj", *QUICK, "--json")
    fails(done)
    assert list(done.result) == ["error"]
    assert "missing.obj" in done.result["error"]


def test_file_that_does_not_exist(command, folder, tmp_path):
    fails(command("segment", tmp_path / "missing.glb", *QUICK), "missing.glb", "no such file")
    fails(command("segment", folder / "pose_0.obj", tmp_path / "missing.glb", *QUICK), "missing.glb", "no such file")


def test_file_that_is_a_folder(command, tmp_path):
    (tmp_path / "folder.obj").mkdir()
    fails(command("segment", tmp_path / "folder.obj", *QUICK), "folder.obj")


def test_file_of_unknown_format(command, tmp_path):
    path = tmp_path / "character.xyz"
    path.write_text("1 2 3")
    fails(command("segment", path, *QUICK), "character.xyz", "unknown format", ".glb")


@pytest.mark.parametrize("suffix", [".blend", ".glb", ".gltf", ".obj", ".ply", ".stl", ".fbx"])
@pytest.mark.parametrize(
    "content", [b"", b"this is no model\n" * 20, b"\x00\xff\x10glTF" * 50], ids=["empty", "text", "binary"]
)
def test_damaged_file(command, tmp_path, suffix, content):
    path = tmp_path / f"damaged{suffix}"
    path.write_bytes(content)
    fails(command("segment", path, *QUICK), "damaged")


@pytest.mark.parametrize("name", ["walker.glb", "walker.blend", "walker.fbx", "pose_0.ply", "pose_0.stl"])
def test_file_that_ends_too_early(command, folder, tmp_path, name):
    path = tmp_path / name
    path.write_bytes((folder / name).read_bytes()[:3000])
    fails(command("segment", path, *QUICK), path.stem)


def test_file_without_a_mesh(command, tmp_path):
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera")))
    for suffix in (".blend", ".glb"):
        fails(command("segment", save(tmp_path / f"nothing{suffix}"), *QUICK), f"nothing{suffix}", "no mesh")


def test_mesh_without_faces(command, tmp_path):
    mesh_object([(0, 0, 0), (1, 0, 0)], [], "Wire")
    fails(command("segment", save(tmp_path / "wire.blend"), *QUICK), '"Wire" has no faces')


def test_not_finite_coordinate(command, tmp_path):
    obj = limbed("Broken")
    obj.data.vertices[3].co.y = float("nan")
    fails(command("segment", save(tmp_path / "broken.blend"), *QUICK), '"Broken"', "vertex 3 ", "not finite")


def test_not_finite_coordinate_at_a_later_frame(command, folder, tmp_path):
    obj = limbed("Burst")
    obj.shape_key_add(name="Basis")
    key = obj.shape_key_add(name="Burst")
    key.data[3].co.x = float("nan")
    key.value = 0
    key.keyframe_insert("value", frame=1)
    key.value = 1
    key.keyframe_insert("value", frame=10)
    done = command("segment", save(tmp_path / "burst.blend"), "--frames", "5:10:2", *QUICK)
    fails(done, "Burst, frame", "not finite")


def test_object_that_is_not_there(command, folder):
    fails(command("segment", folder / "pose_0.obj", "--object", "Nobody", *QUICK), "pose_0.obj", "Nobody")


def test_action_that_is_not_there(command, folder):
    done = command("segment", folder / "walker.blend", "--frames", 2, "--action", "Fly", *QUICK)
    fails(done, '"Fly"', bpy.data.actions[0].name)


def test_shape_keys_that_are_not_there(command, folder):
    fails(command("segment", folder / "pose_0.obj", "--shape-keys", 3, *QUICK), "has no shape keys")


@pytest.mark.parametrize("option", ["--output", "--render", "--model"])
def test_folder_of_an_output_that_does_not_exist(command, folder, tmp_path, option):
    name = tmp_path / "missing" / {"--output": "out.blend", "--render": "out.png", "--model": "m.json"}[option]
    fails(command("segment", folder / "pose_0.obj", *QUICK, option, name), name, "does not exist")
    assert not name.parent.exists()


@pytest.mark.parametrize("option", ["--output", "--render", "--model"])
def test_output_that_is_a_folder(command, folder, tmp_path, option):
    name = tmp_path / {"--output": "out.blend", "--render": "out.png", "--model": "m.json"}[option]
    name.mkdir()
    fails(command("segment", folder / "pose_0.obj", *QUICK, option, name), name.name)


@pytest.mark.skipif(not Path("/proc/self").is_dir(), reason="needs a folder where nobody can write")
@pytest.mark.parametrize("option", ["--output", "--render", "--model"])
def test_output_that_cannot_be_written(command, folder, option, request):
    if option == "--render":
        request.getfixturevalue("needs_rendering")
    name = Path("/proc/self") / {"--output": "out.blend", "--render": "out.png", "--model": "m.json"}[option]
    fails(command("segment", folder / "pose_0.obj", *QUICK, option, name), name)


def test_output_of_unknown_format(command, folder, tmp_path):
    fails(command("segment", folder / "pose_0.obj", *QUICK, "--output", tmp_path / "out.xyz"), "out.xyz", "unknown")


def test_picture_of_unknown_format_is_refused_before_the_work(command, folder, tmp_path):
    name = tmp_path / "out.jpg"
    done = command("segment", folder / "pose_0.obj", *QUICK, "--render", name)
    fails(done, "out.jpg", ".png")
    assert "Signature" not in done.err
    assert not list(tmp_path.iterdir())


def test_apply_without_an_output(command, folder, model):
    fails(command("apply", folder / "pose_0.obj", "--model", model), "--output")


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (None, "no such file"),
        (b"{}", "not a model of WKS Segment"),
        (b"\x80\x04\x95\xff", "binary"),
        (b"hello", "no JSON"),
    ],
)
def test_unreadable_or_foreign_model_file(command, folder, tmp_path, content, words):
    path, output = tmp_path / "foreign.json", tmp_path / "out.blend"
    if content is not None:
        path.write_bytes(content)
    fails(command("apply", folder / "pose_0.obj", "--model", path, "--output", output), "foreign.json", words)
    assert not output.exists()


def test_demo_with_bad_input(command, folder, tmp_path):
    demo = ("demo", "--folder", tmp_path / "demo", *QUICK, "--input")
    fails(command(*demo, tmp_path / "missing.glb"), "missing.glb", "no such file")
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera")))
    fails(command(*demo, save(tmp_path / "nothing.glb")), "nothing.glb")
    fails(command(*demo, folder / "walker.glb", "--learn", 0), "pose to learn from")
    fails(command(*demo, folder / "walker.glb", "--learn", 30, "--unseen", 30), "60 poses", "frames")
    (tmp_path / "demo").write_text("a file")
    fails(command(*demo, folder / "walker.glb"), "demo", "could not be made")


@pytest.mark.parametrize("suffix", [".json", ".blend", ".png"])
def test_demo_whose_results_cannot_be_written(command, folder, tmp_path, suffix, needs_rendering):
    (tmp_path / f"walker{suffix}").mkdir()
    done = command("demo", "--folder", tmp_path, "--input", folder / "walker.glb", *QUICK, "--learn", 1, "--unseen", 1)
    fails(done, f"walker{suffix}")


def test_failed_run_leaves_an_older_output_as_it_was(command, tmp_path):
    obj = limbed("Broken")
    obj.data.vertices[0].co.y = float("nan")
    path, output = save(tmp_path / "broken.blend"), tmp_path / "out.blend"
    output.write_text("older")
    fails(command("segment", path, *QUICK, "--output", output))
    assert output.read_text() == "older"


# A process of its own


def process(*arguments, **options):
    return subprocess.Popen(
        [sys.executable, "-m", "wks_segment", *map(str, arguments)],
        cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, **options,
    )  # fmt: skip


def ended(process):
    """Exit code and output of a process that must end by itself."""
    try:
        out, err = process.communicate(timeout=120)
    finally:
        process.kill()
    return Outcome(process.returncode, out, err)


def test_process_prints_one_json_object_and_ends_with_0(folder, tmp_path):
    output = tmp_path / "out.glb"
    done = ended(process("segment", folder / "walker.glb", "--frames", 2, *QUICK, "--output", output, "--json"))
    assert done.code == 0, done
    assert len(done.result["poses"]) == 2
    assert output.stat().st_size > 10_000


def test_process_that_fails_ends_with_1_and_wrong_usage_with_2(tmp_path):
    done = ended(process("segment", tmp_path / "missing.glb", "--json"))
    assert (done.code, list(done.result)) == (1, ["error"])
    done = ended(process("segment", "x.glb", "--segments", "1"))
    assert (done.code, done.out) == (2, "")
    assert "--segments" in done.err


@pytest.mark.skipif(os.name == "nt", reason="Windows has no SIGINT to send to another process")
def test_process_that_is_interrupted_ends_at_once_and_does_not_crash(folder):
    # A shell makes what it starts in the background ignore the signal, these tests and their processes among it.
    heeding = {"preexec_fn": lambda: signal.signal(signal.SIGINT, signal.SIG_DFL)}
    running = process("segment", folder / "walker.blend", "--frames", 20, **heeding)
    for line in running.stderr:
        if "Signature" in line:
            break
    running.send_signal(signal.SIGINT)
    done = ended(running)
    assert done.code in (1, 128 + signal.SIGINT, -signal.SIGINT), done


# Limits


@pytest.mark.parametrize("name", ["segment", "apply", "demo"])
def test_a_job_above_the_limit_is_refused_and_the_limit_can_be_raised(command, folder, tmp_path, name):
    model = tmp_path / "model.json"
    assert command("learn", folder / "pose_0.blend", *QUICK, "--model", model).code == 0
    arguments = {
        "segment": ("segment", folder / "pose_0.blend", *QUICK, "--output", tmp_path / "out.blend"),
        "apply": ("apply", folder / "pose_0.blend", "--model", model, "--output", tmp_path / "out.blend"),
        "demo": ("demo", "--input", folder / "walker.blend", "--folder", tmp_path, *QUICK),
    }[name]
    refused = command(*arguments, "--limit-memory", "0.001")
    assert (refused.code, "0.0 GB: raise the limit" in refused.err) == (1, True)
    assert command(*arguments, "--limit-memory", "64", "--limit-minutes", "60").code == 0
