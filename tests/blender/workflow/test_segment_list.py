"""The list of segments: its rows, names and colors, selecting and hiding, and the panel."""

import json
from unittest.mock import MagicMock

import bpy
import numpy as np
import pytest
from builders import (
    chosen_in_edit_mode,
    labels_of,
    limbed,
    limbed_poses,
    listed,
    rig,
    select,
)
from height_bands import RED, activate, all_agrees, bands, colors_at, groups_of, write

from wks_segment.blender import registration
from wks_segment.blender.parts.palette import palette
from wks_segment.blender.parts.part_style import SetNotes
from wks_segment.blender.ui import color_icons, segments_panel
from wks_segment.core import PoseSegmentation

pytestmark = pytest.mark.usefixtures("scene")
OPS = bpy.ops.wks_segment


def test_list_shows_parts_with_shares_of_the_area(pair, settings):
    assert [item.name for item in settings.segments] == ["Segment 1", "Segment 2", "Segment 3.L", "Segment 3.R"]
    areas = {}
    for polygon, part in zip(pair[0].data.polygons, labels_of(pair[0]).tolist(), strict=True):
        areas[part] = areas.get(part, 0) + polygon.area
    for item in settings.segments:
        assert item.share == pytest.approx(100 * areas[item.number] / sum(areas.values()), rel=1e-4)
        assert not item.hidden
    np.testing.assert_allclose(settings.segments[0].color, palette()[0], atol=1e-3)


def test_shares_are_of_the_active_character(pair, settings):
    pair[1].scale = (3, 3, 3)
    shares = []
    for first, second in (pair, pair[::-1]):
        select(first, second)
        OPS.refresh_segments()
        shares.append([item.share for item in settings.segments])
    assert shares[0] != pytest.approx(shares[1], rel=1e-4)
    rig(pair)
    select(pair[0])
    OPS.refresh_segments()
    area = [sum(polygon.area for polygon in obj.data.polygons) for obj in pair]
    expected = (area[0] * np.array(shares[0]) + 9 * area[1] * np.array(shares[1])) / (area[0] + 9 * area[1])
    assert [item.share for item in settings.segments] == pytest.approx(expected, rel=1e-4)


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


def test_new_name_is_written_everywhere_and_on_both_sides(pair, settings):
    activate(settings, 1002).name = "Hand"
    assert [item.name for item in settings.segments] == ["Segment 1", "Segment 2", "Hand.L", "Hand.R"]
    activate(settings, 2002).name = "Foot.R"
    assert [item.name for item in settings.segments][2:] == ["Foot.L", "Foot.R"]
    activate(settings, 1).name = "Torso"
    assert all(all_agrees(obj, settings) for obj in pair)
    assert {"Foot.L", "Foot.R", "Torso"} < set(bpy.data.materials.keys())
    assert set(groups_of(pair[0])) == {"WKS Segment 1", "WKS Torso", "WKS Foot.L", "WKS Foot.R"}


def test_names_are_unique_and_an_empty_one_restores_the_number(pair, settings):
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
    notes = settings.notes("bands/3")
    assert SetNotes.of_json(json.loads(settings.label_sets["bands/3"].notes)) == notes != SetNotes()


def test_new_color_is_written_everywhere_for_that_part_only(pair, settings):
    before = {part: colors_at(pair[1], part) for part in (0, 1, 2002)}
    activate(settings, 1002).color = RED
    assert colors_at(pair[0], 1002) == colors_at(pair[1], 1002) == [[255, 0, 0]]
    assert bpy.data.materials["Segment 3.L"].diffuse_color[:] == pytest.approx((1, 0, 0, 1))
    assert {part: colors_at(pair[1], part) for part in before} == before
    assert all(all_agrees(obj, settings) for obj in pair)


def test_changes_of_our_material_by_the_user_are_kept(pair, settings):
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


def test_names_and_colors_last_when_labels_are_written_again(pair, settings):
    activate(settings, 1002).name = "Hand"
    activate(settings, 0).color = RED
    OPS.clear()
    report = write(settings, *pair)
    assert list(report.parts) == ["Segment 1", "Segment 2", "Hand.L", "Hand.R"]
    assert colors_at(pair[0], 0) == [[255, 0, 0]]
    assert all(all_agrees(obj, settings) for obj in pair)


def test_name_from_a_preset(pair, settings):
    activate(settings, 2002)
    assert OPS.name_segment(name="Forearm") == {"FINISHED"}
    assert [item.name for item in settings.segments][2:] == ["Forearm.L", "Forearm.R"]


def test_names_and_colors_are_saved_in_blend_and_model_files(settings, tmp_path):
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


def test_command_line_uses_names_of_the_model(settings, command, tmp_path):
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


def test_hide_isolate_and_show(pair, settings):
    bpy.ops.object.mode_set(mode="EDIT")
    item = activate(settings, 1)
    assert OPS.hide_segment() == {"FINISHED"}
    assert OPS.hide_segment(part=2002) == {"FINISHED"}
    assert [item.hidden for item in settings.segments] == [False, True, False, True]
    assert bpy.context.mode == "EDIT_MESH"
    bpy.ops.object.mode_set(mode="OBJECT")
    for obj in pair:
        np.testing.assert_array_equal(hidden_faces(obj), np.isin(bands(obj), (1, 2002)))
        shown = {vertex for face in obj.data.polygons if not face.hide for vertex in face.vertices}
        assert {vertex.index for vertex in obj.data.vertices if not vertex.hide} == shown
        edges = {key for face in obj.data.polygons if not face.hide for key in face.edge_keys}
        assert {edge.key for edge in obj.data.edges if not edge.hide} == edges
    bpy.ops.object.mode_set(mode="EDIT")
    OPS.hide_segment(part=1)
    assert not settings.segments[1].hidden
    activate(settings, item.number)
    OPS.isolate_segment()
    assert [item.hidden for item in settings.segments] == [True, False, True, True]
    bpy.ops.object.mode_set(mode="OBJECT")
    assert hidden_faces(pair[0]).any()
    OPS.show_segments()
    assert not any(hidden_faces(obj).any() for obj in pair)
    assert not any(edge.hide for edge in pair[0].data.edges)


def test_the_eye_is_open_and_gray_where_blender_shows_hidden_faces(pair, settings):
    """In Object Mode, that is."""
    bpy.ops.object.mode_set(mode="EDIT")
    activate(settings, 1)
    OPS.hide_segment()
    assert eye(settings, 1) == "HIDE_ON"
    bpy.ops.object.mode_set(mode="OBJECT")
    assert eye(settings, 1) == "HIDE_OFF"
    for operator in (OPS.hide_segment, OPS.isolate_segment):
        with pytest.raises(RuntimeError, match="Switch to Edit Mode first: Object Mode also shows hidden faces"):
            operator()


def eye(settings, index):
    """Icon of the eye in a row of the list."""
    layout = MagicMock()
    row = settings.segments[index]
    segments_panel.WKS_SEGMENT_UL_segments.draw_item(
        MagicMock(), bpy.context, layout, settings, row, 0, settings, "", 0, 0
    )
    return layout.row.return_value.operator.call_args.kwargs["icon"]


def test_menu_of_segments_shows_their_colors(pair, settings, monkeypatch):
    layout, asked = MagicMock(), []
    # Without a window all icons have the number 0.
    monkeypatch.setattr(color_icons.ColorIcons, "icon", lambda self, color: asked.append(tuple(color)) or len(asked))
    activate(settings, 0)
    settings.segments[1].color = RED
    segments_panel.WKS_SEGMENT_MT_merge.draw(MagicMock(layout=layout), bpy.context)
    assert [call.kwargs["icon_value"] for call in layout.operator.call_args_list] == [1, 2, 3]
    assert asked == [tuple(row.color) for row in settings.segments[1:]]
    icons = color_icons.color_icons_of(bpy.context)
    pixels = np.array(icons.preview(RED).icon_pixels_float).reshape(2 * [color_icons.ICON_PIXELS] + [4])
    np.testing.assert_allclose(pixels[16, 16], (*RED, 1.0))
    assert pixels[0, 0, 3] == 0
    assert icons.preview(RED) == icons.preview(RED), "a color has one icon"


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
    assert used <= {cls.bl_idname for cls in registration.OPERATORS}
    assert ("wks_segment.assign_faces" in used) == (mode == "EDIT")
    assert ("wks_segment.split_segment" in used) == (mode == "OBJECT")
