"""Why a file cannot be used, in one sentence: what it is instead, what is missing, what to do."""

import json
import struct

import bpy
import numpy as np
import pytest
from builders import limbed, limbed_keys
from command_files import QUICK, assert_fails, empty_scene, save

from wks_segment.blender.cli.commands import segment

SUFFIXES = (".blend", ".glb", ".gltf", ".obj", ".ply", ".stl", ".fbx", ".abc", ".usdc", ".usdz")
OTHER_CONTENT = {
    "Git LFS": b"version https://git-lfs.github.com/spec/v1\noid sha256:319ebbe3\nsize 1302973\n",
    "git-annex": b"/annex/objects/SHA256E-s1302973--319ebbe3.glb\n",
    "web page": b"\xef\xbb\xbf\n<!DOCTYPE html>\n<html><body>Not found</body></html>\n",
    "archive": b"Rar!\x1a\x07\x01\x00" + bytes(80),
    "empty": b" \n",
}


def refused(command, path, *words):
    """Check that a file is refused in one line, with these words and its name."""
    done = command("segment", path, *QUICK, "--json")
    assert_fails(done, path.name, *words)
    reason = done.result["error"]
    assert "\n" not in reason
    assert "Traceback" not in reason
    for word in words:
        assert word in reason


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("content", OTHER_CONTENT)
def test_file_with_other_content(command, tmp_path, suffix, content):
    path = tmp_path / f"character{suffix}"
    path.write_bytes(OTHER_CONTENT[content])
    refused(command, path, content)


@pytest.mark.parametrize("suffix", [".glb", ".ply", ".abc", ".usdc", ".blend"])
def test_file_with_the_suffix_of_another_format(command, tmp_path, suffix):
    path = tmp_path / f"character{suffix}"
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(80))
    refused(command, path, f"no {suffix} file")


def gltf(path, nodes, buffer=None):
    """Write a glTF file with these nodes, and with a triangle in a buffer if one is given."""
    content = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": nodes}
    if buffer is not None:
        content |= {
            "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
            "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
            "bufferViews": [{"buffer": 0, "byteLength": 36}],
            "buffers": [{"uri": buffer, "byteLength": 36}],
        }
    path.write_text(json.dumps(content))
    return path


def test_nodes_that_contain_each_other(command, tmp_path):
    path = gltf(tmp_path / "round.gltf", [{"children": [1]}, {"children": [0]}])
    refused(command, path, "contain each other in a circle")
    content = path.read_bytes() + b" " * (-len(path.read_bytes()) % 4)
    binary = tmp_path / "round.glb"
    binary.write_bytes(struct.pack("<4s4I", b"glTF", 2, 20 + len(content), len(content), 0x4E4F534A) + content)
    refused(command, binary, "contain each other in a circle")


def test_importer_that_fails_in_python(command, tmp_path):
    path = gltf(tmp_path / "odd.gltf", [{"mesh": 7}])
    refused(command, path, "its importer failed (")


def test_buffer_of_a_gltf_file(command, tmp_path):
    path = gltf(tmp_path / "apart.gltf", [{"mesh": 0}], "its%20numbers.bin")
    refused(command, path, "is missing", "its numbers.bin")
    (tmp_path / "its numbers.bin").write_bytes(OTHER_CONTENT["Git LFS"])
    assert_fails(command("segment", path, *QUICK), "its numbers.bin", "git lfs pull")


def test_point_cloud(command, tmp_path):
    fields = ("x", "y", "z", "f_dc_0", "opacity", "scale_0", "rot_0")
    header = "".join(f"property float {field}\n" for field in fields)
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex 30\n{header}end_header\n"
    numbers = np.random.default_rng(0).random(30 * len(fields))
    path = tmp_path / "splats.ply"
    path.write_bytes(header.encode() + struct.pack(f"<{len(numbers)}f", *numbers))
    assert_fails(command("segment", path, *QUICK), '"splats" has no faces', "point cloud")


@pytest.mark.parametrize("kind", ["objects", "meshes"])
def test_library_that_is_missing(command, tmp_path, kind):
    limbed("Walker")
    library = save(tmp_path / "library.blend")
    empty_scene()
    with bpy.data.libraries.load(str(library), link=True) as (source, target):
        setattr(target, kind, getattr(source, kind))
    (block,) = getattr(target, kind)
    bpy.context.scene.collection.objects.link(block if kind == "objects" else bpy.data.objects.new("Walker", block))
    path = save(tmp_path / "shot.blend")
    library.unlink()
    assert_fails(command("segment", path, *QUICK), "missing: library.blend")


def test_other_things_in_a_library_that_is_missing(command, tmp_path):
    """The character is there, so it is labeled, with a warning."""
    limbed("Prop")
    library = save(tmp_path / "library.blend")
    empty_scene()
    limbed("Walker")
    with bpy.data.libraries.load(str(library), link=True) as (source, target):
        target.objects = source.objects
    bpy.context.scene.collection.objects.link(target.objects[0])
    path = save(tmp_path / "shot.blend")
    library.unlink()
    done = command("segment", path, *QUICK, "--json")
    assert done.code == 0, done
    assert any("missing" in warning and "library.blend" in warning for warning in done.result["warnings"])


@pytest.mark.parametrize("option", ["--output", "--render", "--model", "--cache"])
def test_output_with_a_name_that_is_too_long(command, folder, tmp_path, option, monkeypatch):
    """For the file system, or with what is added to a name while the file is written."""
    monkeypatch.setattr(segment, "read_poses", lambda *_: pytest.fail("it must be refused before files are read"))
    suffix = {"--output": ".blend", "--render": ".png", "--model": ".json", "--cache": ""}[option]
    for letters in (300, 255 - len(suffix)) if option != "--cache" else (300,):
        name = tmp_path / ("a" * letters + suffix)
        assert_fails(command("segment", folder / "pose_0.obj", *QUICK, option, name), "too long")


def test_file_with_a_long_name(command, folder, tmp_path):
    assert_fails(command("segment", tmp_path / ("a" * 300 + ".obj"), *QUICK), "too long")
    longest = tmp_path / ("a" * 251 + ".obj")
    longest.write_bytes((folder / "pose_0.obj").read_bytes())
    assert command("segment", longest, *QUICK).code == 0


def test_shape_keys_of_several_objects(command, tmp_path):
    limbed_keys(0.4, 0.8).name = "Keyed"
    limbed("Plain")
    done = command("segment", save(tmp_path / "two.blend"), "--shape-keys", 2, *QUICK, "--json")
    assert done.code == 0, done
    assert {pose["name"].split(",")[0] for pose in done.result["poses"]} == {"Keyed"}
    assert '"Plain" has no shape keys and is left out' in done.result["warnings"]


def test_torn_skin(command, tmp_path):
    obj = limbed("Torn")
    usual = command("segment", save(tmp_path / "usual.blend"), *QUICK, "--json")
    assert not any("triangles" in warning for warning in usual.result["warnings"])
    empty_scene()
    obj = limbed("Torn")
    obj.data.vertices[3].co.x += 100
    done = command("segment", save(tmp_path / "torn.blend"), *QUICK, "--json")
    assert done.code == 0, done
    assert any(warning.startswith('"Torn": ') and "skin" in warning for warning in done.result["warnings"])


def test_frames_without_an_animation_are_told_before_the_computation(command, folder):
    done = command("segment", folder / "pose_0.obj", "--frames", 5, *QUICK)
    assert done.code == 0, done
    warning, _, after = done.err.partition("poses are the same")
    assert "Signature" not in warning
    assert "Signature" in after


def test_turned_off_importer(command, folder, monkeypatch):
    from wks_segment.blender.scene import file_formats

    monkeypatch.setitem(file_formats.IMPORTERS, ".obj", lambda path: bpy.ops.import_scene.no_such(filepath=path))
    assert_fails(command("segment", folder / "pose_0.obj", *QUICK), "turned off or missing")
