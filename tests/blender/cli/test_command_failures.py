"""Wrong usage and failures of the command line: exit codes and messages."""

from pathlib import Path

import bpy
import pytest
from builders import limbed, mesh_object
from command_files import QUICK, assert_fails, save


@pytest.mark.parametrize(
    "arguments",
    [
        (),
        ("frobnicate",),
        ("segment",),
        ("learn", "{pose}"),
        ("apply", "{pose}"),
        ("batch", "apply", "", "--model", "model.json", "--output", "out"),
        ("batch", "learn", "{pose}", "--output", ""),
        ("segment", ""),
        ("segment", "{pose}", "--cache", ""),
        ("rank", "{pose}", "--models", ""),
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
def test_wrong_usage_has_exit_code_2(command, folder, arguments):
    done = command(*(argument.format(pose=folder / "pose_0.obj") for argument in arguments))
    assert done.code == 2, done
    assert "wks_segment" in done.err
    assert not done.out


def test_help_is_printed(command):
    done = command("segment", "--help")
    assert done.code == 0
    for word in ("FIRST:LAST:COUNT", "--segments", "default: 8", "--json"):
        assert word in done.out


def test_failure_with_json_is_one_object(command, tmp_path):
    done = command("segment", tmp_path / "missing.obj", *QUICK, "--json")
    assert_fails(done)
    assert list(done.result) == ["error"]
    assert "missing.obj" in done.result["error"]


def test_file_that_does_not_exist(command, folder, tmp_path):
    assert_fails(command("segment", tmp_path / "missing.glb", *QUICK), "missing.glb", "no such file")
    assert_fails(
        command("segment", folder / "pose_0.obj", tmp_path / "missing.glb", *QUICK), "missing.glb", "no such file"
    )


def test_file_that_is_a_folder(command, tmp_path):
    (tmp_path / "folder.obj").mkdir()
    assert_fails(command("segment", tmp_path / "folder.obj", *QUICK), "folder.obj")


def test_file_of_unknown_format(command, tmp_path):
    path = tmp_path / "character.xyz"
    path.write_text("1 2 3")
    assert_fails(command("segment", path, *QUICK), "character.xyz", "unknown format", ".glb")


@pytest.mark.parametrize("suffix", [".blend", ".glb", ".gltf", ".obj", ".ply", ".stl", ".fbx"])
@pytest.mark.parametrize(
    "content", [b"", b"this is no model\n" * 20, b"\x00\xff\x10glTF" * 50], ids=["empty", "text", "binary"]
)
def test_damaged_file(command, tmp_path, suffix, content):
    path = tmp_path / f"damaged{suffix}"
    path.write_bytes(content)
    assert_fails(command("segment", path, *QUICK), "damaged")


@pytest.mark.parametrize("name", ["walker.glb", "walker.blend", "walker.fbx", "pose_0.ply", "pose_0.stl"])
def test_file_that_ends_too_early(command, folder, tmp_path, name):
    path = tmp_path / name
    path.write_bytes((folder / name).read_bytes()[:3000])
    assert_fails(command("segment", path, *QUICK), path.stem)


def test_file_without_a_mesh(command, tmp_path):
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera")))
    for suffix in (".blend", ".glb"):
        assert_fails(command("segment", save(tmp_path / f"nothing{suffix}"), *QUICK), f"nothing{suffix}", "no mesh")


def test_mesh_without_faces(command, tmp_path):
    mesh_object([(0, 0, 0), (1, 0, 0)], [], "Wire")
    assert_fails(command("segment", save(tmp_path / "wire.blend"), *QUICK), '"Wire" has no faces')


def test_not_finite_coordinate(command, tmp_path):
    obj = limbed("Broken")
    obj.data.vertices[3].co.y = float("nan")
    assert_fails(command("segment", save(tmp_path / "broken.blend"), *QUICK), '"Broken"', "vertex 3 ", "not finite")


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
    assert_fails(done, "Burst, frame", "not finite")


def test_object_that_does_not_exist(command, folder):
    assert_fails(command("segment", folder / "pose_0.obj", "--object", "Nobody", *QUICK), "pose_0.obj", "Nobody")


def test_action_that_does_not_exist(command, folder):
    done = command("segment", folder / "walker.blend", "--frames", 2, "--action", "Fly", *QUICK)
    assert_fails(done, '"Fly"', bpy.data.actions[0].name)


def test_shape_keys_that_do_not_exist(command, folder):
    assert_fails(command("segment", folder / "pose_0.obj", "--shape-keys", 3, *QUICK), "has no shape keys")


@pytest.mark.parametrize("option", ["--output", "--render", "--model"])
def test_folder_of_an_output_that_does_not_exist(command, folder, tmp_path, option):
    name = tmp_path / "missing" / {"--output": "out.blend", "--render": "out.png", "--model": "m.json"}[option]
    assert_fails(command("segment", folder / "pose_0.obj", *QUICK, option, name), name, "does not exist")
    assert not name.parent.exists()


@pytest.mark.parametrize("option", ["--output", "--render", "--model"])
def test_output_that_is_a_folder(command, folder, tmp_path, option):
    name = tmp_path / {"--output": "out.blend", "--render": "out.png", "--model": "m.json"}[option]
    name.mkdir()
    assert_fails(command("segment", folder / "pose_0.obj", *QUICK, option, name), name.name)


@pytest.mark.skipif(not Path("/proc/self").is_dir(), reason="needs a folder to which nobody can write")
@pytest.mark.parametrize("option", ["--output", "--render", "--model"])
def test_output_that_cannot_be_written(command, folder, option, request):
    if option == "--render":
        request.getfixturevalue("needs_rendering")
    name = Path("/proc/self") / {"--output": "out.blend", "--render": "out.png", "--model": "m.json"}[option]
    assert_fails(command("segment", folder / "pose_0.obj", *QUICK, option, name), name)


def test_output_of_unknown_format(command, folder, tmp_path):
    assert_fails(
        command("segment", folder / "pose_0.obj", *QUICK, "--output", tmp_path / "out.xyz"), "out.xyz", "unknown"
    )


def test_picture_of_unknown_format_is_refused_at_once(command, folder, tmp_path):
    name = tmp_path / "out.jpg"
    done = command("segment", folder / "pose_0.obj", *QUICK, "--render", name)
    assert_fails(done, "out.jpg", ".png")
    assert "Signature" not in done.err
    assert not list(tmp_path.iterdir())


def test_demo_with_wrong_input(command, folder, tmp_path):
    demo = ("demo", "--folder", tmp_path / "demo", *QUICK, "--input")
    assert_fails(command(*demo, tmp_path / "missing.glb"), "missing.glb", "no such file")
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera")))
    assert_fails(command(*demo, save(tmp_path / "nothing.glb")), "nothing.glb")
    assert_fails(command(*demo, folder / "walker.glb", "--learn", 0), "pose to learn from")
    assert_fails(command(*demo, folder / "walker.glb", "--learn", 30, "--unseen", 30), "60 poses", "frames")
    (tmp_path / "demo").write_text("a file")
    assert_fails(command(*demo, folder / "walker.glb"), "demo", "could not be made")


@pytest.mark.parametrize("suffix", [".json", ".blend", ".png"])
def test_demo_whose_results_cannot_be_written(command, folder, tmp_path, suffix, needs_rendering):
    (tmp_path / f"walker{suffix}").mkdir()
    done = command("demo", "--folder", tmp_path, "--input", folder / "walker.glb", *QUICK, "--learn", 1, "--unseen", 1)
    assert_fails(done, f"walker{suffix}")


def test_failed_run_keeps_an_older_output(command, tmp_path):
    obj = limbed("Broken")
    obj.data.vertices[0].co.y = float("nan")
    path, output = save(tmp_path / "broken.blend"), tmp_path / "out.blend"
    output.write_text("older")
    assert_fails(command("segment", path, *QUICK, "--output", output))
    assert output.read_text() == "older"
