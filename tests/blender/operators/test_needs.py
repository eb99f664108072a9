"""When buttons are gray, what their tooltips say, and which meshes a selection stands for."""

import bpy
import numpy as np
import pytest
from builders import (
    labels_of,
    limbed,
    limbed_rigged,
    read_labels,
    select,
)

from wks_segment.blender.outputs.labels import write_labels
from wks_segment.blender.scene.characters import selected_meshes
from wks_segment.blender.workflow import segment_list

pytestmark = pytest.mark.usefixtures("scene")
OPS = bpy.ops.wks_segment


def refusal(operator):
    assert not operator.poll()
    with pytest.raises(RuntimeError) as caught:
        operator()
    return str(caught.value)


@pytest.mark.parametrize("name", ["learn", "apply", "clear"])
def test_buttons_are_gray_in_edit_mode(learned, name):
    bpy.ops.object.mode_set(mode="EDIT")
    assert "Switch to Object Mode first" in refusal(getattr(OPS, name))
    bpy.ops.object.mode_set(mode="OBJECT")
    assert getattr(OPS, name).poll()


@pytest.mark.parametrize("name", ["learn", "apply"])
def test_buttons_are_gray_without_a_selected_mesh(learned, name):
    select()
    assert "Select the mesh of a character first" in refusal(getattr(OPS, name))
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    bpy.context.scene.collection.objects.link(camera)
    select(camera)
    assert "Select the mesh of a character first" in refusal(getattr(OPS, name))


def test_selected_armature_selects_its_visible_meshes(settings):
    body, coat, hidden = limbed_rigged("Body"), limbed("Coat"), limbed("Hidden")
    for obj in (coat, hidden):
        obj.parent = body.parent
    bpy.context.view_layer.update()
    hidden.hide_set(True)
    other, alone = limbed_rigged("Other"), limbed("Alone")
    select(body.parent, alone)
    assert [obj.name for obj in selected_meshes(bpy.context)] == ["Alone", "Body", "Coat"]
    select(body.parent, coat, other)
    assert [obj.name for obj in selected_meshes(bpy.context)] == ["Coat", "Other"]


def test_learn_and_apply_through_a_selected_armature(settings):
    obj = limbed_rigged()
    select(obj.parent)
    settings.source, settings.pose_count = "FRAMES", 3
    settings.n_segments, settings.n_eigenpairs, settings.n_energies = 3, 60, 40
    assert OPS.learn() == {"FINISHED"}
    learned = labels_of(obj)
    assert OPS.clear() == {"FINISHED"}
    assert read_labels(obj.data) is None
    assert OPS.apply() == {"FINISHED"}
    assert (labels_of(obj) == learned).mean() > 0.95


def test_clear_through_a_selected_armature_reverts_separation(settings):
    body, coat = limbed_rigged("Body"), limbed("Coat")
    coat.parent = body.parent
    write_labels(body.data, np.arange(len(body.data.polygons)) % 2)
    write_labels(coat.data, np.zeros(len(coat.data.polygons), dtype=np.int64))
    select(body)
    assert OPS.separate() == {"FINISHED"}
    pieces = {obj.name for obj in bpy.data.objects} - {"Body", "Coat", body.parent.name}
    assert len(pieces) == 2
    select(body.parent)
    assert OPS.clear() == {"FINISHED"}
    assert not pieces & {obj.name for obj in bpy.data.objects}
    assert bpy.data.objects["Body"].visible_get()
    assert all(read_labels(bpy.data.objects[name].data) is None for name in ("Body", "Coat"))


def test_list_shows_meshes_of_the_selected_armature(settings):
    one, other = limbed_rigged("One"), limbed_rigged("Other")
    for obj in (one, other):
        write_labels(obj.data, np.zeros(len(obj.data.polygons), dtype=np.int64))
    select(one.parent)
    assert segment_list.labeled(settings) == [one]
    select(other, one.parent)
    assert segment_list.shown_object(settings) is other
    select()
    assert segment_list.labeled(settings) == [one], "a list is of one character"


@pytest.mark.parametrize("name", ["apply", "save_model"])
def test_buttons_are_gray_without_a_model(name):
    select(limbed())
    assert "No model yet" in refusal(getattr(OPS, name))


def test_clear_is_gray_without_segments():
    select(limbed())
    assert "Select an object that has segments" in refusal(OPS.clear)


def test_clear_is_gray_for_a_users_property_with_our_name():
    obj = limbed()
    obj.data["wks_segment"] = 1
    select(obj)
    assert not OPS.clear.poll()
