"""`learn --parts-from`: parts that files have are learned with their names, and found in other files."""

import bpy
import numpy as np
import pytest
from builders import labels_of, limbed
from command_files import assert_fails, empty_scene, save

from wks_segment.core import PoseSegmentation

QUICK = ("--eigenpairs", 30, "--energies", 40)


@pytest.fixture(scope="module")
def painted(extension, tmp_path_factory):
    """A file whose mesh has materials, face sets and vertex groups: one on the long limb, the others elsewhere."""
    empty_scene()
    obj = limbed("Painted")
    there = np.array([polygon.center.x > 1.3 for polygon in obj.data.polygons])
    for name in ("Body", "Limb"):
        obj.data.materials.append(bpy.data.materials.new(name))
    obj.data.polygons.foreach_set("material_index", there.astype(np.int32))
    obj.data.attributes.new(".sculpt_face_set", "INT", "FACE").data.foreach_set("value", np.where(there, 3, 2))
    for name, inside in (("body", ~there), ("limb", there)):
        vertices = {i for polygon in obj.data.polygons if inside[polygon.index] for i in polygon.vertices}
        obj.vertex_groups.new(name=name).add(sorted(vertices), 1.0, "REPLACE")
    return save(tmp_path_factory.mktemp("painted") / "painted.blend")


@pytest.mark.parametrize(
    ("source", "names"),
    [
        ("materials", ["Body", "Limb"]),
        ("face-sets", ["Face Set 2", "Face Set 3"]),
        ("vertex-groups", ["body", "limb"]),
    ],
)
def test_parts_of_a_file_are_learned(command, painted, tmp_path, source, names):
    model = tmp_path / "model.json"
    done = command("learn", painted, "--parts-from", source, *QUICK, "--model", model, "--json")
    assert done.code == 0, done
    assert done.result["taught"] == names
    assert done.result["segments"] == 2
    assert PoseSegmentation.load(model).part_notes_.names == dict(enumerate(names))


def test_bones_name_the_parts_of_other_files(command, folder, tmp_path):
    model, output = tmp_path / "model.json", tmp_path / "out.blend"
    done = command(
        "learn", folder / "walker.glb", "--parts-from", "bones", "--frames", 3, *QUICK, "--model", model, "--json"
    )
    assert done.code == 0, done
    assert done.result["taught"] == ["Torso", "Limb"]
    assert len(done.result["poses"]) == 3
    done = command("apply", folder / "pose_1.obj", "--model", model, "--output", output, "--json")
    assert done.code == 0, done
    assert done.result["parts"] == {"Torso": 0, "Limb": 1}
    bpy.ops.wm.open_mainfile(filepath=str(output))
    (obj,) = [obj for obj in bpy.data.objects if obj.type == "MESH"]
    assert set(labels_of(obj)) == {0, 1}


def test_segment_learns_parts_and_writes_them(command, painted, tmp_path):
    output = tmp_path / "out.blend"
    done = command("segment", painted, "--parts-from", "materials", *QUICK, "--output", output, "--json")
    assert done.code == 0, done
    assert done.result["parts"] == {"Body": 0, "Limb": 1}
    empty_scene()
    done = command("learn", output, "--parts-from", "segments", *QUICK, "--model", tmp_path / "m.json", "--json")
    assert done.code == 0, done
    assert done.result["taught"] == ["Body", "Limb"]


def test_the_number_of_parts_is_taken(command, folder, tmp_path):
    walker = folder / "walker.blend"
    done = command(
        "learn", walker, "--parts-from", "bones", "--parts", 2, *QUICK, "--model", tmp_path / "m.json", "--json"
    )
    assert done.result["taught"] == ["Torso", "Limb"]
    done = command("learn", walker, "--parts-from", "bones", "--parts", 1, "--model", tmp_path / "m.json", "--json")
    assert done.code == 2


@pytest.mark.parametrize(
    ("source", "words"),
    [
        ("bones", ("has no armature", "select a rigged mesh")),
        ("face-sets", ("has no face sets",)),
        ("materials", ("has no materials",)),
        ("vertex-groups", ("has no vertex groups",)),
        ("segments", ("has no segments",)),
    ],
)
def test_what_is_missing_is_said(command, folder, tmp_path, source, words):
    model = tmp_path / "model.json"
    done = command("learn", folder / "pose_0.blend", "--parts-from", source, *QUICK, "--model", model)
    assert_fails(done, *words)
    assert not model.exists()


def test_a_settings_of_an_earlier_command_is_forgotten(command, painted, folder, tmp_path):
    model = tmp_path / "model.json"
    command("learn", painted, "--parts-from", "materials", *QUICK, "--model", model, "--json")
    done = command("learn", folder / "pose_0.obj", *QUICK, "--segments", 3, "--model", model, "--json")
    assert "taught" not in done.result
    assert PoseSegmentation.load(model).part_notes_.names == {}
