"""Learn from My Parts: named parts of an artist or of a rig, learned and found again."""

import bpy
import numpy as np
import pytest
from builders import changes, labels_of, limbed, limbed_rigged, scene_snapshot, select

from wks_segment.core import PoseSegmentation

pytestmark = pytest.mark.usefixtures("scene")
OPS = bpy.ops.wks_segment


def on_limb(obj):
    """(p,) whether each polygon is on the long limb."""
    return np.array([polygon.center.x > 1.3 for polygon in obj.data.polygons])


def with_materials(obj, *names):
    """The object with two materials, the second on the long limb."""
    for name in names:
        obj.data.materials.append(bpy.data.materials.get(name) or bpy.data.materials.new(name))
    for polygon, there in zip(obj.data.polygons, on_limb(obj), strict=True):
        polygon.material_index = int(there)
    return obj


def names_of(settings):
    return [item.name for item in settings.segments]


def share_right(obj, number):
    """Share of the polygons that are on the limb if and only if they have the number of a part."""
    return float(np.mean((labels_of(obj) == number) == on_limb(obj)))


@pytest.fixture
def taught(settings):
    """An object of which two materials were taught, and another pose of it."""
    one, other = with_materials(limbed("One"), "Body", "Limb"), limbed("Other", 0.4)
    settings.parts_from = "MATERIALS"
    select(one)
    assert OPS.teach() == {"FINISHED"}
    return one, other


def test_materials_are_learned_with_their_names(taught, settings):
    one, _ = taught
    assert names_of(settings) == ["Body", "Limb"]
    assert share_right(one, 1) > 0.97
    assert settings.n_segments == 2
    assert [row.name for row in settings.models] == ["One"]


def test_another_mesh_inherits_parts_and_names(taught, settings):
    _, other = taught
    select(other)
    assert OPS.apply() == {"FINISHED"}
    assert names_of(settings) == ["Body", "Limb"]
    assert share_right(other, 1) > 0.93


def test_the_names_are_in_the_exported_model(taught, settings, tmp_path):
    OPS.save_model(filepath=str(tmp_path / "model.json"))
    assert PoseSegmentation.load(tmp_path / "model.json").part_notes_.names == {0: "Body", 1: "Limb"}


def test_undo_restores_everything(settings):
    one = with_materials(limbed("One"), "Body", "Limb")
    settings.parts_from, settings.write_materials = "MATERIALS", True
    select(one)
    bpy.ops.ed.undo_push(message="before")
    before = scene_snapshot()
    OPS.teach()
    bpy.ops.ed.undo_push(message="taught")
    assert changes(before, scene_snapshot())
    bpy.ops.ed.undo()
    assert not changes(before, scene_snapshot())


def test_the_parts_of_the_artist_stay(taught):
    one, _ = taught
    assert [slot.material.name for slot in one.material_slots] == ["Body", "Limb"]
    assert [polygon.material_index for polygon in one.data.polygons] == on_limb(one).astype(int).tolist()


def test_a_few_strokes_are_enough(settings):
    one, other = limbed("One"), limbed("Other", 0.3)
    centers = np.array([polygon.center for polygon in one.data.polygons])
    strokes = np.ones(len(centers), dtype=np.int32)
    strokes[(centers[:, 0] > 1.8) & (centers[:, 0] < 2.4)] = 2
    strokes[(np.abs(centers[:, 0]) < 0.2)] = 3
    one.data.attributes.new(".sculpt_face_set", "INT", "FACE").data.foreach_set("value", strokes)
    settings.parts_from = "FACE_SETS"
    select(one)
    assert OPS.teach() == {"FINISHED"}
    assert set(names_of(settings)) == {"Face Set 2", "Face Set 3"}
    select(other)
    OPS.apply()
    limb = next(item.number for item in settings.segments if item.name == "Face Set 2")
    assert share_right(other, limb) > 0.85


def test_several_meshes_at_once(settings):
    poses = [with_materials(limbed(f"Pose {i}", bend), "Body", "Limb") for i, bend in enumerate((0.0, 0.4))]
    unseen = limbed("Unseen", 0.8)
    settings.parts_from = "MATERIALS"
    select(*poses)
    assert OPS.teach() == {"FINISHED"}
    select(unseen)
    OPS.apply()
    assert names_of(settings) == ["Body", "Limb"]
    assert share_right(unseen, 1) > 0.9


def test_corrected_segments_are_learned(settings):
    one = limbed("One")
    select(one)
    OPS.learn()
    settings.segments[0].name = "Belly"
    before, count = labels_of(one).copy(), len(settings.segments)
    settings.parts_from = "SEGMENTS"
    assert OPS.teach() == {"FINISHED"}
    assert "Belly" in names_of(settings)
    assert len(settings.segments) == count
    assert (labels_of(one) == before).mean() > 0.8


def test_bones_are_learned_from_an_animation(settings):
    one = limbed_rigged("Walker")
    settings.source, settings.pose_count, settings.parts_from = "FRAMES", 3, "BONES"
    select(one)
    assert OPS.teach() == {"FINISHED"}
    assert names_of(settings) == ["Torso", "Limb"]
    assert share_right(one, 1) > 0.95
    assert "3 poses" in settings.model_summary


def test_a_mesh_without_animation_is_one_pose(settings):
    settings.source, settings.parts_from = "FRAMES", "MATERIALS"
    select(with_materials(limbed("One"), "Body", "Limb"))
    assert OPS.teach() == {"FINISHED"}
    assert "1 pose\n" in settings.model_summary


def test_another_number_of_segments_changes_no_taught_model(taught, settings):
    _, other = taught
    select(other)
    settings.n_segments = 5
    assert OPS.apply() == {"FINISHED"}
    assert settings.n_segments == 2
    assert names_of(settings) == ["Body", "Limb"]


def test_a_chair_does_not_fit(taught, settings):
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=30, y_subdivisions=30)
    chair = bpy.context.object
    chair.scale.x = 5
    select(chair)
    OPS.rank()
    assert [item.fits for item in settings.ranking] == [False]
    assert "No model fits" in settings.verdict


@pytest.mark.parametrize(
    ("source", "message"),
    [
        ("BONES", '"Limbed" has no armature: select a rigged mesh'),
        ("SEGMENTS", '"Limbed" has no segments: make some first'),
        ("FACE_SETS", '"Limbed" has no face sets: draw some'),
        ("MATERIALS", '"Limbed" has no materials: assign some'),
        ("VERTEX_GROUPS", '"Limbed" has no vertex groups: add some'),
    ],
)
def test_what_is_missing_is_said(settings, source, message):
    select(limbed())
    settings.parts_from = source
    before = scene_snapshot()
    with pytest.raises(RuntimeError, match=message):
        OPS.teach()
    assert not changes(before, scene_snapshot())


def test_one_part_alone_is_refused_or_learned_with_the_rest(settings):
    one = limbed("One")
    one.data.attributes.new(".sculpt_face_set", "INT", "FACE").data.foreach_set(
        "value", np.where(on_limb(one), 2, 1).astype(np.int32)
    )
    settings.parts_from = "FACE_SETS"
    select(one)
    with pytest.raises(RuntimeError, match='There is only one part, "Face Set 2": add another one'):
        OPS.teach()
    settings.unlabeled = "learn"
    assert OPS.teach() == {"FINISHED"}
    assert names_of(settings)[0] == "Face Set 2"
    assert len(settings.segments) > 1
    assert share_right(one, 0) > 0.9
