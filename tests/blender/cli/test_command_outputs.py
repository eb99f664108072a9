"""`wks_segment segment`: files that are written, and the result that is printed."""

import bpy
import numpy as np
import pytest
from builders import labels_of, limbed, numbers, select
from command_files import QUICK, assert_fails, empty_scene, mesh_of_scene, save

from wks_segment.blender.parts.palette import palette
from wks_segment.core import PoseSegmentation


def test_materials_are_written_on_request(command, folder, tmp_path):
    output = tmp_path / "out.blend"
    command("segment", folder / "pose_0.obj", *QUICK, "--materials", "--output", output)
    bpy.ops.wm.open_mainfile(filepath=str(output))
    names = [material.name for material in mesh_of_scene().data.materials]
    assert names == ["Segment 1", "Segment 2", "Segment 3", "Segment 4"]


def test_blend_output_keeps_the_model(command, folder, tmp_path):
    output = tmp_path / "out.blend"
    assert command("segment", folder / "pose_0.obj", *QUICK, "--output", output).code == 0
    bpy.ops.wm.open_mainfile(filepath=str(output))
    obj = mesh_of_scene()
    labels = labels_of(obj)
    select(obj)
    assert bpy.ops.wks_segment.apply() == {"FINISHED"}
    assert (labels_of(obj) == labels).mean() > 0.95


def test_blend_output_keeps_the_content_of_the_file(command, folder, tmp_path):
    output = tmp_path / "out.blend"
    command("segment", folder / "walker.blend", "--frames", "1:21:3", *QUICK, "--output", output)
    bpy.ops.wm.open_mainfile(filepath=str(output))
    walker = bpy.data.objects["Walker"]
    assert walker.parent.animation_data.action is not None
    assert [group.name for group in walker.vertex_groups] == ["root", "limb"]
    assert len(bpy.data.scenes) == 1


def test_output_can_be_the_input_file(command, folder, tmp_path):
    limbed("Own")
    path = save(tmp_path / "own.blend")
    assert command("segment", path, *QUICK, "--output", path).code == 0
    bpy.ops.wm.open_mainfile(filepath=str(path))
    assert len(np.unique(labels_of(bpy.data.objects["Own"]))) == 4


def palette_distance(colors):
    """(n,) largest difference of a channel between each sRGB color and the nearest of the first four of the palette."""
    return np.abs(colors[:, None] - palette()[None, :4]).max(axis=2).min(axis=1)


def srgb(linear):
    return np.where(linear < 0.0031308, 12.92 * linear, 1.055 * np.maximum(linear, 1e-9) ** (1 / 2.4) - 0.055)


@pytest.mark.parametrize("suffix", [".glb", ".obj"])
def test_colors_are_in_the_output(command, folder, tmp_path, suffix):
    output = tmp_path / f"out{suffix}"
    assert command("segment", folder / "pose_0.obj", *QUICK, "--output", output).code == 0
    empty_scene()
    if suffix == ".glb":
        bpy.ops.import_scene.gltf(filepath=str(output))
    else:
        bpy.ops.wm.obj_import(filepath=str(output))
    mesh = mesh_of_scene().data
    assert len(mesh.color_attributes) == 1
    colors = srgb(numbers(mesh, mesh.color_attributes[0].name, "color", 4)[:, :3])
    near = palette_distance(colors) < 0.02
    # An .obj file has colors of vertices only, which are mixed along borders.
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
    poses = (folder / "pose_0.obj", folder / "pose_2.obj")
    done = command("segment", *poses, *QUICK, "--render", picture, "--tile", 50, "--json")
    assert done.code == 0, done
    assert list(bpy.data.images.load(str(picture)).size) == [100, 50]
    assert done.result["files"] == {"render": str(picture)}
    assert done.result["seconds"]["render"] > 0


def test_text_output_is_a_table(command, folder):
    done = command("segment", folder / "pose_0.obj", *QUICK)
    assert done.code == 0, done
    lines = done.out.splitlines()
    assert lines[0].split() == ["pose", "vertices"]
    assert "642" in lines[2]
    assert any(line == "4 segments" for line in lines)
    assert any(line.startswith("warning: Learned from one pose only") for line in lines)


@pytest.mark.parametrize("name", ["segment", "learn"])
def test_number_of_segments_can_be_automatic(command, folder, tmp_path, name):
    model = tmp_path / "model.json"
    done = command(name, folder / "pose_0.obj", *QUICK, "--segments", "auto", "--model", model, "--json")
    assert done.code == 0, done
    curve = PoseSegmentation.load(model).grouping_.curve()
    assert done.result["certainty"] == {str(i): round(curve[i - 1], 3) for i in range(2, 17)}
    assert 2 <= done.result["segments"] <= 16
    (note,) = done.result["notes"]
    assert f"({PoseSegmentation.load(model).n_segments_} taken)" in note
    assert note in command(name, folder / "pose_0.obj", *QUICK, "--segments", "auto", "--model", model).out


def test_certainty_is_reported_except_with_the_papers_preset(command, folder):
    given = command("segment", folder / "pose_0.obj", *QUICK, "--json").result
    assert len(given["certainty"]) == 15
    assert given["notes"] == []
    assert "certainty" not in command("segment", folder / "pose_0.obj", *QUICK, "--preset", "paper", "--json").result


def test_number_of_segments_cannot_be_automatic_with_the_papers_preset(command, folder):
    done = command("segment", folder / "pose_0.obj", *QUICK, "--segments", "auto", "--preset", "paper")
    assert_fails(done, "needs a fixed number of segments")


def test_snap_to_option_sets_the_setting(command, folder, tmp_path):
    output = tmp_path / "out.blend"
    done = command("segment", folder / "pose_0.obj", *QUICK, "--snap-to", "seams,sharp", "--output", output)
    assert done.code == 0, done
    assert bpy.context.scene.wks_segment.snap_to == {"seams", "sharp"}


def test_progress_goes_to_standard_error(command, folder):
    done = command("segment", folder / "pose_0.obj", *QUICK, "--json")
    assert "Signature of" in done.err
    assert "%" in done.err
