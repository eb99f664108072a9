"""Parts that an artist has made, read as what a model is taught."""

import bpy
import numpy as np
import pytest
from builders import limbed, select

from wks_segment.blender.errors import UserError
from wks_segment.blender.outputs.taught_parts import taught_parts
from wks_segment.blender.scene.characters import Character
from wks_segment.blender.scene.poses import read_objects

pytestmark = pytest.mark.usefixtures("scene")


def right(obj):
    """(p,) whether each polygon of an object is on the long limb."""
    return np.array([polygon.center.x > 1.0 for polygon in obj.data.polygons])


def with_materials(obj, *names):
    """The object with two materials, the second on the long limb."""
    for name in names:
        obj.data.materials.append(bpy.data.materials.get(name) or bpy.data.materials.new(name))
    for polygon, there in zip(obj.data.polygons, right(obj), strict=True):
        polygon.material_index = int(there)
    return obj


def with_face_sets(obj, numbers):
    obj.data.attributes.new(".sculpt_face_set", "INT", "FACE").data.foreach_set("value", np.asarray(numbers, np.int32))
    return obj


def read(source, *objects, sides=True, all_face_sets=False, told=None):
    characters = [Character((obj,)) for obj in objects]
    parts = taught_parts(characters, source, sides, all_face_sets, [] if told is None else told)
    return parts.names, [parts.labels[character] for character in characters]


def test_materials():
    obj = with_materials(limbed(), "Skin", "Glove.L")
    names, (labels,) = read("MATERIALS", obj)
    assert names == ["Skin", "Glove.L"]
    assert np.array_equal(labels, right(obj))


def test_the_same_name_is_the_same_part_on_all_meshes():
    one, other = with_materials(limbed("One"), "Skin", "Glove"), with_materials(limbed("Other"), "Glove", "Hat")
    names, (first, second) = read("MATERIALS", one, other)
    assert names == ["Skin", "Glove", "Hat"]
    assert set(first) == {0, 1}
    assert set(second) == {1, 2}


def test_an_empty_slot_is_no_part():
    obj = with_materials(limbed(), "Skin", "Glove")
    obj.material_slots[0].material = None
    names, (labels,) = read("MATERIALS", obj)
    assert names == ["Glove"]
    assert np.array_equal(labels, np.where(right(obj), 0, -1))


def test_strokes_of_face_sets_leave_the_rest_unsaid():
    obj = limbed()
    with_face_sets(obj, np.where(right(obj), 7, 1))
    names, (labels,) = read("FACE_SETS", obj)
    assert names == ["Face Set 7"]
    assert np.array_equal(labels, np.where(right(obj), 0, -1))
    names, (labels,) = read("FACE_SETS", obj, all_face_sets=True)
    assert names == ["Face Set 1", "Face Set 7"]
    assert np.array_equal(labels, right(obj))


def test_vertex_groups():
    obj = limbed()
    inside = right(obj)
    vertices = [i for polygon, there in zip(obj.data.polygons, inside, strict=True) if there for i in polygon.vertices]
    obj.vertex_groups.new(name="hand_l").add(vertices, 1, "ADD")
    names, (labels,) = read("VERTEX_GROUPS", obj)
    assert names == ["hand.L"]
    assert (labels >= 0)[inside].all()
    assert (labels < 0).mean() > 0.5


def test_segments_with_the_names_of_the_artist(settings):
    select(limbed())
    bpy.ops.wks_segment.learn()
    settings.segments[0].name = "Belly"
    names, (labels,) = read("SEGMENTS", bpy.data.objects["Limbed"])
    assert names[0] == "Belly"
    assert len(names) == len(settings.segments) == len(np.unique(labels))


def test_sides_can_be_joined():
    obj = with_materials(limbed(), "Glove.L", "Glove.R")
    assert read("MATERIALS", obj)[0] == ["Glove.L", "Glove.R"]
    names, (labels,) = read("MATERIALS", obj, sides=False)
    assert names == ["Glove"]
    assert set(labels) == {0}


def test_a_mesh_without_parts_is_told_and_left_to_the_model():
    told = []
    _, labels = read("MATERIALS", with_materials(limbed("One"), "A", "B"), limbed("Bare"), told=told)
    assert set(labels[1]) == {-1}
    assert told == ['"Bare" has no parts and is left to the model']


@pytest.mark.parametrize(
    ("source", "message"),
    [
        ("MATERIALS", '"Limbed" has no materials'),
        ("FACE_SETS", '"Limbed" has no face sets'),
        ("VERTEX_GROUPS", '"Limbed" has no vertex groups'),
        ("SEGMENTS", '"Limbed" has no segments'),
    ],
)
def test_no_parts_are_refused(source, message):
    with pytest.raises(UserError, match=message):
        read(source, limbed())


def test_a_mesh_that_nobody_painted_is_refused():
    obj = limbed()
    with pytest.raises(UserError, match="There is no part: paint a face set"):
        read("FACE_SETS", with_face_sets(obj, np.ones(len(obj.data.polygons))))


def test_parts_that_no_pose_shows_leave_no_gap():
    obj = limbed()
    numbers = np.where(right(obj), 3, 5)
    numbers[:2] = 4  # two faces are a slip of the brush
    character = Character((with_face_sets(obj, numbers),))
    parts = taught_parts([character], "FACE_SETS", True, False, [])
    names, (labels,) = parts.of_poses(read_objects(bpy.context, [character]))
    assert len(parts.names) == 3
    assert len(names) == 2
    assert np.unique(labels).tolist() == [-1, 0, 1]
    assert (labels < 0).sum() == 2
