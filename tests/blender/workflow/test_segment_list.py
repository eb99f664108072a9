"""The list of segments: every button does what it says on the data, everywhere, and undo gives back what was."""

import json
from unittest.mock import MagicMock

import bpy
import numpy as np
import pytest
from builders import (
    add_face,
    changes,
    choose,
    chosen_in_edit_mode,
    labels_of,
    limbed,
    limbed_poses,
    listed,
    numbers,
    scene_snapshot,
    select,
    snapshot,
)

from wks_segment.blender import operators
from wks_segment.blender.outputs.overrides import by_hand
from wks_segment.blender.parts import part_ids
from wks_segment.blender.parts.palette import palette
from wks_segment.blender.scene.characters import Character
from wks_segment.blender.ui import segments_panel
from wks_segment.blender.workflow import pipeline
from wks_segment.blender.workflow.report import Report
from wks_segment.core import PartNotes, PoseSegmentation

pytestmark = pytest.mark.usefixtures("scene")
OPS = bpy.ops.wks_segment
RED = (1.0, 0.0, 0.0)


def bands(obj):
    """A part by height: 0 below and at the end of a limb, 1 in the middle, 1002 and 2002 above, by side."""
    centers = np.array([polygon.center for polygon in obj.data.polygons])
    above = np.where(centers[:, 0] > 0, 1002, 2002)
    above = np.where(centers[:, 0] > 2.2, 0, above)
    return np.where(centers[:, 2] > 0.4, above, np.where(centers[:, 2] > -0.2, 1, 0))


def write(settings, *objects):
    """Write bands to objects, as Apply to Selected would."""
    report = Report([])
    write_labels(settings, {Character((obj,)): bands(obj) for obj in objects}, report)
    return report


def write_labels(settings, labels, report=None, renumbered=False):
    """Write parts of polygons, as a model would give them."""
    request = pipeline.LabelRequest.of(settings, labels)
    pipeline.write_outputs(settings, labels, request, report or Report([]), renumbered=renumbered)


@pytest.fixture
def pair(settings):
    """Two objects with parts 0, 1, 1002 and 2002, in colors, materials and hard vertex groups."""
    settings.write_materials, settings.vertex_groups = True, "hard"
    objects = [limbed("First"), limbed("Second", bend=0.5)]
    select(*objects)
    write(settings, *objects)
    return objects


def activate(settings, part):
    settings.active_segment = [item.number for item in settings.segments].index(part)
    return settings.segments[settings.active_segment]


def colors_at(obj, part):
    """The different colors, in 0 to 255, at the corners of a part's faces."""
    at = np.repeat(labels_of(obj) == part, [len(polygon.vertices) for polygon in obj.data.polygons])
    return np.unique(np.rint(255 * numbers(obj.data, "wks_segment_color", "color_srgb", 4)[at, :3]), axis=0).tolist()


def material_at(obj, part):
    """Names of the materials on a part's faces."""
    where = np.flatnonzero(labels_of(obj) == part).tolist()
    return {obj.data.materials[obj.data.polygons[i].material_index].name for i in where}


def groups_of(obj):
    return [group.name for group in obj.vertex_groups]


def members(obj, group):
    index = obj.vertex_groups[group].index
    return {vertex.index for vertex in obj.data.vertices if any(g.group == index and g.weight for g in vertex.groups)}


def corners_of(obj, part):
    where = np.flatnonzero(labels_of(obj) == part).tolist()
    return {vertex for i in where for vertex in obj.data.polygons[i].vertices}


def all_agrees(obj, settings):
    """Colors, materials, groups and the vertices' attribute say what the faces' labels and the list say."""
    style, found = settings.style(), part_ids.unique_parts(labels_of(obj))
    for part in found:
        expected = np.rint(255 * style.colors_of(np.array(part)))
        np.testing.assert_allclose(colors_at(obj, part), [expected], atol=1)
        assert material_at(obj, part) == {style.name_of(part)}
        assert members(obj, f"WKS {style.name_of(part)}") == corners_of(obj, part)
    assert groups_of(obj) == [f"WKS {style.name_of(part)}" for part in found]
    assert set(numbers(obj.data, "wks_segment_vertex")) <= set(found)
    assert {item.number for item in settings.segments} >= set(found)
    return True


def in_object_mode(read, *arguments):
    bpy.ops.object.mode_set(mode="OBJECT")
    return read(*arguments)


# The list


def test_list_has_what_was_written_with_its_share_of_the_area(pair, settings):
    assert [item.name for item in settings.segments] == ["Segment 1", "Segment 2", "Segment 3.L", "Segment 3.R"]
    areas = {}
    for obj in pair:
        for polygon, part in zip(obj.data.polygons, labels_of(obj).tolist(), strict=True):
            areas[part] = areas.get(part, 0) + polygon.area
    for item in settings.segments:
        assert item.share == pytest.approx(100 * areas[item.number] / sum(areas.values()), rel=1e-4)
        assert not item.hidden
    np.testing.assert_allclose(settings.segments[0].color, palette()[0], atol=1e-3)


def test_share_is_that_of_the_selected_objects_or_of_all(pair, settings):
    both = [item.share for item in settings.segments]
    pair[1].scale = (3, 3, 3)
    select(pair[0])
    OPS.refresh_segments()
    first = [item.share for item in settings.segments]
    select()
    OPS.refresh_segments()
    weighted = [item.share for item in settings.segments]
    assert first != pytest.approx(both, rel=1e-4)
    select(pair[1])
    OPS.refresh_segments()
    second = [item.share for item in settings.segments]
    area = [sum(polygon.area for polygon in obj.data.polygons) for obj in pair]
    expected = (area[0] * np.array(first) + 9 * area[1] * np.array(second)) / (area[0] + 9 * area[1])
    assert weighted == pytest.approx(expected, rel=1e-4)


def test_learn_apply_and_clear_fill_the_list(settings):
    objects = limbed_poses(0.0, 0.4)
    select(*objects)
    assert OPS.learn() == {"FINISHED"}
    assert {item.number for item in settings.segments} == set(labels_of(objects[0])) | set(labels_of(objects[1]))
    select(objects[1])
    assert OPS.apply() == {"FINISHED"}
    assert {item.number for item in settings.segments} == set(labels_of(objects[1]))
    select(*objects)
    OPS.clear()
    assert not settings.segments


@pytest.mark.parametrize(
    "name",
    ["select_segment", "hide_segment", "isolate_segment", "show_segments", "name_segment", "merge_segments",
     "split_segment", "assign_faces", "new_segment", "forget_faces", "restore_segments"],
)  # fmt: skip
def test_buttons_are_gray_without_segments(name):
    select(limbed())
    assert not getattr(OPS, name).poll()


# Names and colors


def test_a_new_name_is_written_everywhere_and_to_the_other_side(pair, settings):
    activate(settings, 1002).name = "Hand"
    assert [item.name for item in settings.segments] == ["Segment 1", "Segment 2", "Hand.L", "Hand.R"]
    activate(settings, 2002).name = "Foot.R"
    assert [item.name for item in settings.segments][2:] == ["Foot.L", "Foot.R"]
    activate(settings, 1).name = "Torso"
    assert all(all_agrees(obj, settings) for obj in pair)
    assert {"Foot.L", "Foot.R", "Torso"} < set(bpy.data.materials.keys())
    assert set(groups_of(pair[0])) == {"WKS Segment 1", "WKS Torso", "WKS Foot.L", "WKS Foot.R"}


def test_names_are_different_and_an_empty_one_gives_back_the_number(pair, settings):
    activate(settings, 0).name = "Leg"
    activate(settings, 1).name = "Leg"
    assert settings.segments[1].name == "Leg 2"
    activate(settings, 1).name = "Segment 1"
    assert settings.segments[1].name == "Segment 1"  # which no other part is called now
    activate(settings, 0).name = ""
    assert settings.segments[0].name == "Segment 1"
    long = "x" * 80
    activate(settings, 1002).name = long
    assert [item.name for item in settings.segments][2:] == ["x" * 48 + ".L", "x" * 48 + ".R"]
    assert PartNotes.of_json(json.loads(settings.part_notes)) == settings.notes() != PartNotes()


def test_a_new_color_is_written_everywhere_and_only_to_that_part(pair, settings):
    before = {part: colors_at(pair[1], part) for part in (0, 1, 2002)}
    activate(settings, 1002).color = RED
    assert colors_at(pair[0], 1002) == colors_at(pair[1], 1002) == [[255, 0, 0]]
    assert bpy.data.materials["Segment 3.L"].diffuse_color[:] == pytest.approx((1, 0, 0, 1))
    assert {part: colors_at(pair[1], part) for part in before} == before
    assert all(all_agrees(obj, settings) for obj in pair)


def test_what_the_artist_changed_of_our_material_stays(pair, settings):
    shader = bpy.data.materials["Segment 2"].node_tree.nodes["Principled BSDF"]
    shader.inputs["Roughness"].default_value = 0.125
    activate(settings, 1).color = RED
    activate(settings, 1).name = "Torso"
    activate(settings, 0)
    OPS.merge_segments(into=1)
    shader = bpy.data.materials["Torso"].node_tree.nodes["Principled BSDF"]
    assert shader.inputs["Roughness"].default_value == 0.125
    assert shader.inputs["Base Color"].default_value[:] == pytest.approx((1, 0, 0, 1))
    assert not bpy.data.materials["Torso"].use_fake_user


def test_names_and_colors_hold_when_labels_are_written_again(pair, settings):
    activate(settings, 1002).name = "Hand"
    activate(settings, 0).color = RED
    OPS.clear()
    report = write(settings, *pair)
    assert list(report.parts) == ["Segment 1", "Segment 2", "Hand.L", "Hand.R"]
    assert colors_at(pair[0], 0) == [[255, 0, 0]]
    assert all(all_agrees(obj, settings) for obj in pair)


def test_a_name_from_the_preset(pair, settings):
    activate(settings, 2002)
    assert OPS.name_segment(name="Forearm") == {"FINISHED"}
    assert [item.name for item in settings.segments][2:] == ["Forearm.L", "Forearm.R"]


def test_names_and_colors_stay_with_the_blend_file_and_the_model_file(settings, tmp_path):
    objects = limbed_poses(0.0, 0.4)
    select(*objects)
    OPS.learn()
    first, second = settings.segments[0].number, settings.segments[1].number
    settings.segments[0].name, settings.segments[1].color = "Head", RED
    model, blend = tmp_path / "model.json", tmp_path / "scene.blend"
    OPS.save_model(filepath=str(model))
    notes = PoseSegmentation.load(model).part_notes_
    assert notes.names == {first: "Head"}
    assert notes.colors == {second: pytest.approx(RED)}
    before = listed(settings)
    bpy.ops.wm.save_as_mainfile(filepath=str(blend))
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    settings = bpy.context.scene.wks_segment
    assert listed(settings) == before
    assert settings.segments[1].color[:] == pytest.approx(RED)

    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    settings = bpy.context.scene.wks_segment
    other = limbed("Other", bend=0.2)
    select(other)
    assert OPS.load_model(filepath=str(model)) == {"FINISHED"}
    OPS.apply()
    assert settings.segments[0].name == "Head"
    assert colors_at(other, second) == [[255, 0, 0]]


def test_command_line_takes_names_from_the_model(settings, command, tmp_path):
    objects = limbed_poses(0.0, 0.4)
    select(*objects)
    OPS.learn()
    settings.segments[0].name = "Head"
    OPS.save_model(filepath=str(tmp_path / "model.json"))
    bpy.ops.wm.obj_export(filepath=str(tmp_path / "pose.obj"), export_selected_objects=True)
    done = command(
        "apply", tmp_path / "pose.obj", "--model", tmp_path / "model.json", "--output", tmp_path / "out.blend",
        "--materials", "--json",
    )  # fmt: skip
    assert "Head" in done.result["parts"]
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "out.blend"))
    assert "Head" in bpy.data.materials


# Select, hide, isolate


def test_select_enters_edit_mode_with_the_faces_selected(pair, settings):
    activate(settings, 1)
    assert OPS.select_segment() == {"FINISHED"}
    assert bpy.context.mode == "EDIT_MESH"
    assert tuple(bpy.context.scene.tool_settings.mesh_select_mode) == (False, False, True)
    activate(settings, 0)
    OPS.select_segment(extend=True)
    for obj in pair:
        faces, vertices = chosen_in_edit_mode(obj)
        np.testing.assert_array_equal(faces, np.isin(bands(obj), (0, 1)))
        touched = {i for face, chosen in zip(obj.data.polygons, faces, strict=True) if chosen for i in face.vertices}
        assert set(np.flatnonzero(vertices)) == touched
    activate(settings, 1002)
    OPS.select_segment()
    np.testing.assert_array_equal(chosen_in_edit_mode(pair[0])[0], bands(pair[0]) == 1002)


def hidden_faces(obj):
    hidden = np.empty(len(obj.data.polygons), dtype=bool)
    obj.data.polygons.foreach_get("hide", hidden)
    return hidden


@pytest.mark.parametrize("mode", ["OBJECT", "EDIT"])
def test_hide_isolate_and_show(pair, settings, mode):
    bpy.ops.object.mode_set(mode=mode)
    item = activate(settings, 1)
    assert OPS.hide_segment() == {"FINISHED"}
    assert OPS.hide_segment(part=2002) == {"FINISHED"}
    assert [item.hidden for item in settings.segments] == [False, True, False, True]
    assert bpy.context.object.mode == mode
    bpy.ops.object.mode_set(mode="OBJECT")
    for obj in pair:
        np.testing.assert_array_equal(hidden_faces(obj), np.isin(bands(obj), (1, 2002)))
        shown = {vertex for face in obj.data.polygons if not face.hide for vertex in face.vertices}
        assert {vertex.index for vertex in obj.data.vertices if not vertex.hide} == shown
        edges = {key for face in obj.data.polygons if not face.hide for key in face.edge_keys}
        assert {edge.key for edge in obj.data.edges if not edge.hide} == edges
    bpy.ops.object.mode_set(mode=mode)
    OPS.hide_segment(part=1)
    assert not settings.segments[1].hidden
    activate(settings, item.number)
    OPS.isolate_segment()
    assert [item.hidden for item in settings.segments] == [True, False, True, True]
    OPS.show_segments()
    bpy.ops.object.mode_set(mode="OBJECT")
    assert not any(hidden_faces(obj).any() for obj in pair)
    assert not any(edge.hide for edge in pair[0].data.edges)


# Merge, split, restore


def test_merged_segments_are_one_everywhere_and_stay_so(pair, settings):
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


def test_only_another_segment_of_the_list_can_be_merged_with(pair, settings):
    activate(settings, 1)
    before = scene_snapshot()
    for into in (-1, 1, 7):
        with pytest.raises(RuntimeError, match="Choose another segment of the list"):
            OPS.merge_segments("EXEC_DEFAULT", into=into)
    assert not changes(before, scene_snapshot())


def test_split_makes_parts_of_connected_pieces_the_same_on_all_meshes(settings):
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


def coordinates_of_faces(obj):
    return np.array([polygon.center for polygon in obj.data.polygons])


def test_split_leaves_crumbs_with_the_nearest_piece_and_a_single_piece_alone(settings, printed):
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
    assert "is in one piece" in printed().out


# By hand


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


def test_only_what_is_in_edit_mode_is_assigned(pair, settings):
    select(pair[0])
    activate(settings, 2002)
    choose(pair[0], np.arange(len(pair[0].data.polygons)) < 9)
    pair[1].select_set(True)  # as in the outliner; from_pydata selects all of its faces
    OPS.assign_faces()
    assert (pair[0].mode, pair[1].mode, pair[1].select_get()) == ("EDIT", "OBJECT", True)
    np.testing.assert_array_equal(labels_of(pair[1]), bands(pair[1]))
    choose(pair[0], np.zeros(len(pair[0].data.polygons)))
    assert OPS.assign_faces() == {"CANCELLED"}


def test_corrections_are_kept_by_apply_and_forgotten_on_request(settings):
    objects = limbed_poses(0.0, 0.4)
    select(*objects)
    OPS.learn()
    model = labels_of(objects[0])
    chosen = np.arange(len(model)) < 50
    select(objects[0])
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


def test_new_faces_of_the_artist_are_not_by_hand(pair, settings):
    mesh = pair[0].data
    select(pair[0])
    activate(settings, 0)
    choose(pair[0], np.arange(len(mesh.polygons)) == 3)
    OPS.assign_faces()
    add_face(mesh)
    assert in_object_mode(by_hand, mesh)[-1] == -1


def test_soft_weights_follow(settings):
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


def test_clear_removes_all_of_it(settings):
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


def test_an_attribute_of_the_artist_with_our_name_is_left_alone(settings):
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


# Learning again


def test_names_colors_and_corrections_follow_a_model_that_is_learned_again(settings):
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
    write_labels(settings, {character: other}, renumbered=True)
    notes = settings.notes()
    assert notes.names[4] == "Legs"
    assert notes.colors == {0: pytest.approx(RED)}
    assert "Hand.L" not in notes.names.values()
    np.testing.assert_array_equal(labels_of(obj)[:9], 0)
    np.testing.assert_array_equal(labels_of(obj)[9:], other[9:])


def test_faces_by_hand_of_a_part_that_is_no_more_are_a_part_of_their_own(settings):
    obj = limbed()
    select(obj)
    write(settings, obj)
    activate(settings, 0).name = "Legs"
    chosen = np.arange(len(obj.data.polygons)) < 9
    choose(obj, chosen)
    OPS.assign_faces()
    bpy.ops.object.mode_set(mode="OBJECT")
    other = np.arange(len(chosen)) % 3
    write_labels(settings, {Character((obj,)): other}, renumbered=True)
    np.testing.assert_array_equal(labels_of(obj), np.where(chosen, 500, other))
    assert settings.style().name_of(500) == "Legs"


# The panel


def drawn(layout):
    """Icons and operators in what was drawn."""
    calls = [(call[0].split(".")[-1], call[1], call[2]) for call in layout.mock_calls]
    return {keys["icon"] for _, _, keys in calls if "icon" in keys}, {
        of[0] for name, of, _ in calls if name == "operator"
    }


@pytest.mark.parametrize("mode", ["OBJECT", "EDIT"])
def test_panel_menus_and_rows_can_be_drawn(pair, settings, mode):
    settings.faces_by_hand = 3
    bpy.ops.object.mode_set(mode=mode)
    icons, used = set(), set()
    for cls in segments_panel.CLASSES:
        layout = MagicMock()
        if cls is segments_panel.WKS_SEGMENT_UL_segments:
            cls.draw_item(MagicMock(), bpy.context, layout, settings, settings.segments[0], 0, settings, "", 0, 0)
        else:
            cls.draw(MagicMock(layout=layout), bpy.context)
        found = drawn(layout)
        assert layout.mock_calls
        icons, used = icons | found[0], used | found[1]
    known = bpy.types.UILayout.bl_rna.functions["operator"].parameters["icon"].enum_items.keys()
    assert icons <= set(known)
    assert used <= {cls.bl_idname for cls in operators.CLASSES}
    assert ("wks_segment.assign_faces" in used) == (mode == "EDIT")
    assert ("wks_segment.split_segment" in used) == (mode == "OBJECT")


def test_panel_says_what_to_do_without_segments(settings):
    layout = MagicMock()
    segments_panel.WKS_SEGMENT_PT_segments.draw(MagicMock(layout=layout), bpy.context)
    assert "learn a model" in str(layout.mock_calls)


# Undo


def merge(settings):
    OPS.merge_segments(into=settings.segments[2].number)


STEPS = {
    "rename": lambda settings: setattr(settings.segments[2], "name", "Hand"),
    "recolor": lambda settings: setattr(settings.segments[2], "color", RED),
    "name": lambda settings: OPS.name_segment(name="Torso"),
    "merge": merge,
    "split": lambda settings: OPS.split_segment(),
    "hide": lambda settings: OPS.hide_segment(),
    "isolate": lambda settings: OPS.isolate_segment(),
    "select": lambda settings: OPS.select_segment(),
    "restore": lambda settings: OPS.restore_segments(),
    "forget": lambda settings: OPS.forget_faces(),
}


@pytest.mark.parametrize("step", STEPS)
def test_undo_gives_back_what_was(pair, settings, step):
    activate(settings, 0)
    if step in ("restore", "forget"):
        OPS.split_segment()
    bpy.ops.ed.undo_push(message="before")
    before = scene_snapshot()
    STEPS[step](settings)
    bpy.ops.ed.undo_push(message="after")
    mode = bpy.context.object.mode
    if mode == "OBJECT":
        after = scene_snapshot()
        assert changes(before, after)
    assert bpy.ops.ed.undo() == {"FINISHED"}
    assert bpy.context.object.mode == "OBJECT"
    # Blender's undo leaves tool settings as they are, that of what is selected in Edit Mode among them.
    assert not changes(before, {**scene_snapshot(), "active": before["active"], "tools": before["tools"]})
    assert bpy.ops.ed.redo() == {"FINISHED"}
    assert bpy.context.object.mode == mode
    if mode == "OBJECT":
        assert not changes(after, {**scene_snapshot(), "active": after["active"]})


@pytest.mark.parametrize("step", ["assign", "new", "forget"])
def test_undo_in_edit_mode_gives_back_what_was(pair, settings, step):
    activate(settings, 0)
    if step == "forget":
        OPS.split_segment()
    choose(pair[0], np.arange(len(pair[0].data.polygons)) < 300)
    bpy.ops.ed.undo_push(message="chosen")
    bpy.ops.object.mode_set(mode="OBJECT")
    before = scene_snapshot()
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.ed.undo_push(message="before")
    run = {"assign": OPS.assign_faces, "new": OPS.new_segment, "forget": OPS.forget_faces}[step]
    assert run() == {"FINISHED"}
    bpy.ops.ed.undo_push(message="after")
    assert bpy.ops.ed.undo() == {"FINISHED"}
    assert bpy.context.mode == "EDIT_MESH"
    bpy.ops.object.mode_set(mode="OBJECT")
    assert not changes(before, {**scene_snapshot(), "active": before["active"]})
