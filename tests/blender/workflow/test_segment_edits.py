"""Merging, splitting and assigning by hand: all outputs agree, and the edits last when labels are written again."""

import bpy
import numpy as np
import pytest
from builders import (
    add_face,
    changes,
    choose,
    labels_of,
    limbed,
    limbed_poses,
    numbers,
    scene_snapshot,
    select,
    snapshot,
)
from height_bands import (
    RED,
    activate,
    all_agrees,
    bands,
    coordinates_of_faces,
    groups_of,
    in_object_mode,
    style_on,
    write,
    write_labels,
)

from wks_segment.blender.outputs.overrides import by_hand
from wks_segment.blender.scene.characters import Character

pytestmark = pytest.mark.usefixtures("scene")
OPS = bpy.ops.wks_segment


def test_merged_segments_are_one_in_all_outputs(pair, settings):
    activate(settings, 1002)
    assert OPS.merge_segments(into=1) == {"FINISHED"}
    activate(settings, 1)
    assert OPS.merge_segments(into=0) == {"FINISHED"}
    assert [item.number for item in settings.segments] == [0, 2002]
    assert settings.active_segment == 0
    expected = [np.where(bands(obj) == 2002, 2002, 0) for obj in pair]
    for _ in range(2):
        for obj, labels in zip(pair, expected, strict=True):
            np.testing.assert_array_equal(labels_of(obj), labels)
            assert all_agrees(obj, settings)
        OPS.clear()
        write(settings, *pair)
    assert OPS.restore_segments() == {"FINISHED"}
    for obj in pair:
        np.testing.assert_array_equal(labels_of(obj), bands(obj))
        assert all_agrees(obj, settings)


def test_the_report_counts_what_the_list_shows(settings, printed):
    """Also after a merge, which it mentions."""
    select(limbed())
    settings.n_segments = 4
    OPS.learn()
    first, second, *others = settings.segments
    assert len(others) == 2
    settings.active_segment, told = 0, f"Merged {first.name} into {second.name}: 3 segments"
    printed()
    OPS.merge_segments(into=second.number)
    assert told in printed().out
    assert len(settings.segments) == 3
    OPS.apply()
    said = printed().out
    assert ", 3 segments, 1 merged into another, " in said
    assert "Warning" not in said
    assert len(settings.segments) == 3


def test_merging_needs_another_segment_of_the_list(pair, settings):
    activate(settings, 1)
    before = scene_snapshot()
    for into in (-1, 1, 7):
        with pytest.raises(RuntimeError, match="Choose another segment to merge"):
            OPS.merge_segments("EXEC_DEFAULT", into=into)
    assert not changes(before, scene_snapshot())


def test_split_numbers_regions_alike_on_all_meshes(settings):
    settings.min_share = 0.5
    objects = [limbed("First"), limbed("Second", bend=0.4), limbed("Finer", subdivisions=5)]
    select(*objects)
    tips = {obj: np.linalg.norm(coordinates_of_faces(obj), axis=1) > 1.25 for obj in objects}
    write_labels(settings, {Character((obj,)): np.where(tips[obj], 3, 0) for obj in objects})
    activate(settings, 3).name = "Limb"
    assert OPS.split_segment() == {"FINISHED"}
    assert [item.name for item in settings.segments] == ["Segment 1", "Limb", "Limb 2", "Limb 3"]
    assert len({tuple(item.color) for item in settings.segments}) == 4
    directions = []
    for obj in objects:
        labels, centers = labels_of(obj), coordinates_of_faces(obj)
        np.testing.assert_array_equal(labels != 0, tips[obj])
        middle = np.array([centers[labels == part].mean(axis=0) for part in (3, 500, 501)])
        directions.append(middle / np.linalg.norm(middle, axis=1)[:, None])
    np.testing.assert_allclose(directions[2], directions[0], atol=0.1)
    assert ((directions[1] * directions[0]).sum(axis=1) > 0.9).all()
    written = [labels_of(obj) for obj in objects]
    write_labels(settings, {Character((obj,)): np.where(tips[obj], 3, 0) for obj in objects})
    for obj, labels in zip(objects, written, strict=True):
        np.testing.assert_array_equal(labels_of(obj), labels)
    activate(settings, 501)
    OPS.merge_segments(into=500)
    assert set(labels_of(objects[0])) == {0, 3, 500}


def test_split_ignores_small_regions_and_refuses_a_single_one(settings, printed):
    obj = limbed()
    select(obj)
    centers = coordinates_of_faces(obj)
    labels = np.where(np.linalg.norm(centers, axis=1) > 1.25, 3, 0)
    crumb = int(np.argmin(np.linalg.norm(centers, axis=1)))
    labels[crumb] = 3
    settings.min_share = 1.0
    write_labels(settings, {Character((obj,)): labels})
    activate(settings, 3)
    OPS.split_segment()
    assert len(settings.segments) == 4
    activate(settings, 500)
    printed()
    assert OPS.split_segment() == {"CANCELLED"}
    assert "is one connected region" in printed().out


def test_faces_assigned_by_hand_keep_their_segment(pair, settings):
    chosen = np.arange(len(pair[0].data.polygons)) % 7 == 0
    activate(settings, 2002)
    select(pair[0])
    choose(pair[0], chosen)
    assert OPS.assign_faces() == {"FINISHED"}
    assert bpy.context.mode == "EDIT_MESH"
    assert settings.faces_by_hand == chosen.sum()
    expected = np.where(chosen, 2002, bands(pair[0]))
    for _ in range(2):
        np.testing.assert_array_equal(in_object_mode(labels_of, pair[0]), expected)
        np.testing.assert_array_equal(by_hand(pair[0].data), np.where(chosen, 2002, -1))
        assert all_agrees(pair[0], settings)
        write(settings, *pair)
    np.testing.assert_array_equal(labels_of(pair[1]), bands(pair[1]))
    assert settings.faces_by_hand == chosen.sum()


def test_only_objects_in_edit_mode_are_assigned(pair, settings):
    select(pair[0])
    activate(settings, 2002)
    choose(pair[0], np.arange(len(pair[0].data.polygons)) < 9)
    pair[1].select_set(True)  # as in the outliner; from_pydata selects all of its faces
    OPS.assign_faces()
    assert (pair[0].mode, pair[1].mode, pair[1].select_get()) == ("EDIT", "OBJECT", True)
    np.testing.assert_array_equal(labels_of(pair[1]), bands(pair[1]))
    choose(pair[0], np.zeros(len(pair[0].data.polygons)))
    assert OPS.assign_faces() == {"CANCELLED"}


def test_faces_by_hand_last_until_forgotten(settings):
    objects = limbed_poses(0.0, 0.4)
    select(*objects)
    OPS.learn()
    select(objects[0])
    OPS.apply()  # alone, as below: the labels of both poses together differ in a few faces
    model = labels_of(objects[0])
    chosen = np.arange(len(model)) < 50
    target = settings.segments[-1].number
    activate(settings, target)
    choose(objects[0], chosen)
    OPS.assign_faces()
    bpy.ops.object.mode_set(mode="OBJECT")
    assert OPS.apply() == {"FINISHED"}
    assert set(labels_of(objects[0])[chosen]) == {target}
    # In Edit Mode those that are selected, in Object Mode all.
    choose(objects[0], np.arange(len(model)) < 20)
    assert OPS.forget_faces() == {"FINISHED"}
    assert settings.faces_by_hand == 30
    bpy.ops.object.mode_set(mode="OBJECT")
    np.testing.assert_array_equal(labels_of(objects[0])[:20], model[:20])
    assert set(labels_of(objects[0])[20:50]) == {target}
    assert OPS.forget_faces() == {"FINISHED"}
    np.testing.assert_array_equal(labels_of(objects[0]), model)
    assert not OPS.forget_faces.poll()
    assert "wks_segment_by_hand" not in objects[0].data.attributes


def test_new_segment_from_faces(pair, settings):
    chosen = np.arange(len(pair[0].data.polygons)) % 5 == 0
    select(pair[0])
    choose(pair[0], chosen)
    assert OPS.new_segment(name="Belt") == {"FINISHED"}
    assert settings.segments[settings.active_segment].name == "Belt"
    np.testing.assert_array_equal(in_object_mode(labels_of, pair[0]), np.where(chosen, 500, bands(pair[0])))
    assert all_agrees(pair[0], settings)
    activate(settings, 500).name = "Buckle"
    assert all_agrees(pair[0], settings)


def test_new_faces_are_not_by_hand(pair, settings):
    mesh = pair[0].data
    select(pair[0])
    activate(settings, 0)
    choose(pair[0], np.arange(len(mesh.polygons)) == 3)
    OPS.assign_faces()
    add_face(mesh)
    assert in_object_mode(by_hand, mesh)[-1] == -1


def test_soft_weights_are_merged(settings):
    objects = limbed_poses(0.0, 0.4)
    select(*objects)
    settings.vertex_groups = "soft"
    OPS.learn()
    obj, names = objects[0], groups_of(objects[0])
    weight = {name: weights(obj, name) for name in names}
    first, second = settings.segments[0], settings.segments[1]
    gone, kept = f"WKS {first.name}", f"WKS {second.name}"
    activate(settings, first.number)
    OPS.merge_segments(into=second.number)
    assert groups_of(obj) == [name for name in names if name != gone]
    np.testing.assert_allclose(weights(obj, kept), weight[gone] + weight[kept], atol=1e-6)
    OPS.apply()
    np.testing.assert_allclose(sum(weights(obj, name) for name in groups_of(obj)), 1, atol=1e-5)


def weights(obj, name):
    found, index = np.zeros(len(obj.data.vertices)), obj.vertex_groups[name].index
    for vertex in obj.data.vertices:
        for member in vertex.groups:
            if member.group == index:
                found[vertex.index] = member.weight
    return found


def test_clear_removes_all_edits(settings):
    obj = limbed()
    select(obj)
    before = snapshot(obj.data)
    settings.write_materials, settings.vertex_groups = True, "hard"
    write(settings, obj)
    activate(settings, 0)
    OPS.merge_segments(into=1)
    choose(obj, np.arange(len(obj.data.polygons)) < 9)
    OPS.new_segment()
    bpy.ops.object.mode_set(mode="OBJECT")
    assert "wks_segment_model" in obj.data.attributes
    OPS.clear()
    after = snapshot(obj.data)
    assert [name for name in after["attributes"] if name.startswith("wks")] == []
    selection = {"/selection", "/attributes/.select_vert", "/attributes/.select_edge", "/attributes/.select_poly"}
    edit_mode = {f"/attributes/.uv_select_{kind}" for kind in ("vert", "edge", "face")}
    assert set(changes(before, after)) <= selection | edit_mode
    assert not bpy.data.materials


def test_users_attribute_with_our_name_is_kept(settings):
    obj = limbed()
    select(obj)
    own = obj.data.attributes.new("wks_segment_by_hand", "FLOAT", "POINT")
    own.data.foreach_set("value", np.full(len(obj.data.vertices), 0.5, dtype=np.float32))
    write(settings, obj)
    choose(obj, np.arange(len(obj.data.polygons)) < 9)
    activate(settings, 1)
    OPS.assign_faces()
    bpy.ops.object.mode_set(mode="OBJECT")
    assert (by_hand(obj.data)[:9] == 1).all()
    OPS.clear()
    assert set(numbers(obj.data, "wks_segment_by_hand")) == {0.5}


def test_names_colors_and_faces_by_hand_are_carried_over(settings):
    obj = limbed()
    select(obj)
    labels = bands(obj)
    write(settings, obj)
    activate(settings, 0).name = "Legs"
    activate(settings, 1).color = RED
    activate(settings, 1002).name = "Hand"
    choose(obj, np.arange(len(labels)) < 9)
    activate(settings, 1)
    OPS.assign_faces()
    bpy.ops.object.mode_set(mode="OBJECT")
    # The new model numbers parts otherwise, and has none where the hands were.
    other = np.where(labels == 0, 4, np.where(labels == 1, 0, 1))
    other[labels == 1002] = np.arange((labels == 1002).sum()) % 5 + 5
    character = Character((obj,))
    write_labels(settings, {character: other}, of="other/10")
    notes = settings.notes("other/10")
    assert notes.names[4] == "Legs"
    assert notes.colors == {0: pytest.approx(RED)}
    assert "Hand.L" not in notes.names.values()
    np.testing.assert_array_equal(labels_of(obj)[:9], 0)
    np.testing.assert_array_equal(labels_of(obj)[9:], other[9:])


def test_faces_by_hand_without_a_successor_become_a_part(settings):
    obj = limbed()
    select(obj)
    write(settings, obj)
    activate(settings, 0).name = "Legs"
    chosen = np.arange(len(obj.data.polygons)) < 9
    choose(obj, chosen)
    OPS.assign_faces()
    bpy.ops.object.mode_set(mode="OBJECT")
    other = np.arange(len(chosen)) % 3
    write_labels(settings, {Character((obj,)): other}, of="other/3")
    np.testing.assert_array_equal(labels_of(obj), np.where(chosen, 500, other))
    assert style_on(obj).name_of(500) == "Legs"
