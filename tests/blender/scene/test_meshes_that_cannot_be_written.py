"""Meshes in Edit Mode through another object, and library overrides, are refused before anything is computed."""

import bpy
import pytest
from builders import limbed, refuses, select
from painted_objects import stripes

from wks_segment.blender.outputs.labels import write_labels

pytestmark = pytest.mark.usefixtures("scene")
OPS = bpy.ops.wks_segment


@pytest.fixture
def edited(settings):
    """An object in Object Mode whose mesh is in Edit Mode through another one."""
    obj, pose = limbed("A"), limbed("C", 0.9)
    write_labels(obj.data, stripes(obj.data))
    twin = bpy.data.objects.new("B", obj.data)
    bpy.context.scene.collection.objects.link(twin)
    select(twin)
    bpy.ops.object.mode_set(mode="EDIT")
    twin.select_set(False)
    bpy.context.view_layer.objects.active = obj
    obj.select_set(True)
    pose.select_set(True)
    assert (bpy.context.mode, obj.mode, twin.mode) == ("OBJECT", "OBJECT", "EDIT")
    yield obj
    bpy.context.view_layer.objects.active = twin
    bpy.ops.object.mode_set(mode="OBJECT")


@pytest.mark.parametrize("operator", ["learn", "clear", "separate", "bake", "unwrap", "segments_from", "transfer"])
def test_a_mesh_in_edit_mode_through_another_object_is_refused(edited, operator):
    if operator == "transfer":
        select(edited, bpy.data.objects["C"])
    with pytest.raises(RuntimeError, match='"A" is in Edit Mode through "B", which has the same mesh: leave it first'):
        getattr(OPS, operator)()
    assert edited.data.is_editmode


def test_a_color_is_chosen_while_a_mesh_is_in_edit_mode_through_another_object(edited, settings):
    other = bpy.data.objects["C"]
    write_labels(other.data, stripes(other.data))
    select(other)
    OPS.refresh_segments()
    settings.segments[0].color = (1.0, 0.0, 0.0)
    assert tuple(settings.segments[0].color) == pytest.approx((1, 0, 0))
    color = other.data.color_attributes["wks_segment_color"].data
    assert any(tuple(value.color_srgb)[:3] == (1, 0, 0) for value in color)


def test_a_library_override_of_a_mesh_is_refused(settings, tmp_path):
    limbed("Linked")
    path = str(tmp_path / "library.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path, copy=True)
    bpy.data.batch_remove([*bpy.data.objects, *bpy.data.meshes])
    with bpy.data.libraries.load(path, link=True) as (there, here):
        here.objects = there.objects
    obj = here.objects[0].override_create()
    obj.data = obj.data.override_create()
    bpy.context.scene.collection.objects.link(obj)
    select(obj)
    refuses(OPS.learn, 'The mesh of "Linked" is a library override, of which Blender would not save the segments')


def test_an_override_of_an_object_with_a_mesh_of_this_file_keeps_its_segments(settings, tmp_path):
    limbed("Linked")
    path = str(tmp_path / "library.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path, copy=True)
    bpy.data.batch_remove([*bpy.data.objects, *bpy.data.meshes])
    with bpy.data.libraries.load(path, link=True) as (there, here):
        here.objects = there.objects
    obj = here.objects[0].override_create()
    obj.data = obj.data.copy()
    bpy.context.scene.collection.objects.link(obj)
    select(obj)
    OPS.learn()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "scene.blend"))
    assert "wks_segment" in bpy.context.scene.objects["Linked"].data.attributes
