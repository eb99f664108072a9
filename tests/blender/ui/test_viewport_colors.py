"""Viewports show the colors of segments as long as there are any, also after undo and redo."""

import bpy
import pytest
from builders import limbed, select
from painted_objects import stripes

from wks_segment.blender.outputs.labels import write_labels

pytestmark = pytest.mark.usefixtures("scene")
OPS = bpy.ops.wks_segment


def viewport():
    """The area and the space of a 3D viewport."""
    screen = bpy.context.window_manager.windows[0].screen
    area = next(area for area in screen.areas if area.type == "VIEW_3D")
    return area, area.spaces.active


def shown():
    return viewport()[1].shading.color_type


def in_viewport(operator):
    area, _ = viewport()
    window = bpy.context.window_manager.windows[0]
    with bpy.context.temp_override(window=window, screen=window.screen, area=area):
        return operator()


@pytest.fixture(params=["MATERIAL", "RANDOM"])
def color_type(request, settings):
    viewport()[1].shading.color_type = request.param
    obj = limbed(subdivisions=2)
    write_labels(obj.data, stripes(obj.data))
    select(obj)
    return request.param


def step(name, change):
    change()
    bpy.ops.ed.undo_push(message=name)


def test_colors_follow_undo_and_redo_of_clear(settings, color_type):
    obj = bpy.data.objects["Limbed"]
    obj.vertex_groups.new(name="All").add(range(len(obj.data.vertices)), 1.0, "REPLACE")
    bpy.ops.ed.undo_push(message="start")
    step("labels", lambda: in_viewport(lambda: OPS.segments_from(source="VERTEX_GROUPS")))
    assert shown() == "VERTEX"
    step("clear", lambda: in_viewport(OPS.clear))
    assert shown() == color_type
    bpy.ops.ed.undo()
    assert shown() == "VERTEX"
    bpy.ops.ed.redo()
    assert shown() == color_type


def test_a_choice_of_the_user_stays(settings, color_type):
    obj = bpy.data.objects["Limbed"]
    obj.vertex_groups.new(name="All").add(range(len(obj.data.vertices)), 1.0, "REPLACE")
    step("labels", lambda: in_viewport(lambda: OPS.segments_from(source="VERTEX_GROUPS")))
    step("clear", lambda: in_viewport(OPS.clear))
    viewport()[1].shading.color_type = "SINGLE"
    bpy.ops.ed.undo()
    assert shown() == "SINGLE"
