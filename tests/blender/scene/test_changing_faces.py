"""Faces that change from frame to frame: such frames are left out by name, or refused if all are."""

import bpy
import numpy as np
import pytest
from builders import labels_of, limbed, refuses, select

from wks_segment.blender.errors import UserError
from wks_segment.blender.scene import poses as reader
from wks_segment.blender.scene.characters import Character

pytestmark = pytest.mark.usefixtures("scene")
LEARN = bpy.ops.wks_segment.learn


def cached(tmp_path, suffix, first, last):
    """A file in which a body has these shares of its faces in frames 1 and 10."""
    obj = limbed("Body")
    decimate = obj.modifiers.new("Decimate", "DECIMATE")
    for frame, ratio in ((1, first), (10, last)):
        decimate.ratio = ratio
        decimate.keyframe_insert("ratio", frame=frame)
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = 1, 10
    scene.frame_set(1)
    path = tmp_path / f"body{suffix}"
    if suffix == ".abc":
        bpy.ops.wm.alembic_export(filepath=str(path), start=1, end=10, as_background_job=False)
    else:
        bpy.ops.wm.usd_export(filepath=str(path), export_animation=True)
    bpy.data.objects.remove(obj)
    return path


def imported(path):
    if path.suffix == ".abc":
        bpy.ops.wm.alembic_import(filepath=str(path), as_background_job=False)
    else:
        bpy.ops.wm.usd_import(filepath=str(path))
    bpy.context.scene.frame_set(1)
    return next(obj for obj in bpy.data.objects if obj.type == "MESH")


def in_frames(settings, *frames):
    settings.source, settings.use_frame_range = "FRAMES", True
    settings.frame_first, settings.frame_last, settings.pose_count = frames


@pytest.mark.parametrize("suffix", [".abc", ".usdc"])
@pytest.mark.parametrize(("first", "last"), [(0.4, 1.0), (1.0, 0.4)])
def test_frames_of_a_cache_with_other_faces_are_left_out_by_name(settings, tmp_path, suffix, first, last):
    path = cached(tmp_path, suffix, first, last)
    obj = imported(path)
    select(obj)
    in_frames(settings, 1, 1, 1)
    assert LEARN() == {"FINISHED"}
    alone = labels_of(obj)
    in_frames(settings, 1, 10, 3)
    assert LEARN() == {"FINISHED"}
    assert "1 pose," in settings.model_summary.replace("\n", ", ")
    np.testing.assert_array_equal(labels_of(obj), alone)
    in_frames(settings, 8, 10, 2)
    refuses(LEARN, r'frame 8": ".*" has [\d,]+ faces there that are not those of its mesh')


def test_the_command_line_names_the_frames(command, tmp_path):
    path = cached(tmp_path, ".abc", 0.4, 1.0)
    quick = ("--segments", 4, "--eigenpairs", 30, "--energies", 40)
    done = command("segment", path, "--frames", "1:10:3", *quick, "--json")
    assert done.code == 0, done
    assert sum("frame 6" in warning or "frame 10" in warning for warning in done.result["warnings"]) == 2
    done = command("segment", path, "--frames", "8:10:2", *quick)
    assert (done.code, "frame 8" in done.err, "Traceback" in done.err) == (1, True, False), done


def test_frames_in_which_nodes_change_the_faces_are_left_out():
    """The faces that most of the frames have stay."""
    obj = limbed("Body", subdivisions=2)
    modifier = obj.modifiers.new("Nodes", "NODES")
    tree = modifier.node_group = bpy.data.node_groups.new("Finer", "GeometryNodeTree")
    for side in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Geometry", in_out=side, socket_type="NodeSocketGeometry")
    start, finer, time, later, end = (
        tree.nodes.new(kind)
        for kind in (
            "NodeGroupInput",
            "GeometryNodeSubdivideMesh",
            "GeometryNodeInputSceneTime",
            "ShaderNodeMath",
            "NodeGroupOutput",
        )
    )
    later.operation = "GREATER_THAN"
    later.inputs[1].default_value = 7
    tree.links.new(time.outputs["Frame"], later.inputs[0])
    tree.links.new(later.outputs[0], finer.inputs["Level"])
    tree.links.new(start.outputs[0], finer.inputs[0])
    tree.links.new(finer.outputs[0], end.inputs[0])
    left_out = []
    poses = reader.read_frames(bpy.context, Character((obj,)), [1, 8, 9], left_out=left_out)
    assert [pose.name for pose in poses] == ["Body, frame 8", "Body, frame 9"]
    assert len(left_out) == 1
    assert '"Body, frame 1"' in left_out[0]
    with pytest.raises(UserError, match=r"frame 1.*its nodes change them"):
        reader.read_frames(bpy.context, Character((obj,)), [1, 8, 9])


def test_faces_of_decimate_depend_on_the_frame_and_are_traced():
    obj = limbed("Body")
    decimate = obj.modifiers.new("Decimate", "DECIMATE")
    for frame, ratio in ((1, 0.9), (10, 0.4)):
        decimate.ratio = ratio
        decimate.keyframe_insert("ratio", frame=frame)
    first, second = reader.read_frames(bpy.context, Character((obj,)), [1, 10])
    assert first.mesh.n_faces > second.mesh.n_faces
    assert second.polygon_of.min() >= 0
