"""Undo of everything that the list of segments can do."""

import bpy
import numpy as np
import pytest
from builders import (
    changes,
    choose,
    scene_snapshot,
)
from height_bands import RED, activate

pytestmark = pytest.mark.usefixtures("scene")
OPS = bpy.ops.wks_segment


def merge(settings):
    OPS.merge_segments(into=settings.segments[2].number)


STEPS = {
    "rename": lambda settings: setattr(settings.segments[2], "name", "Hand"),
    "recolor": lambda settings: setattr(settings.segments[2], "color", RED),
    "name": lambda settings: OPS.name_segment(name="Torso"),
    "merge": merge,
    "split": lambda settings: OPS.split_segment(),
    "select": lambda settings: OPS.select_segment(),
    "restore": lambda settings: OPS.restore_segments(),
    "forget": lambda settings: OPS.forget_faces(),
}


@pytest.mark.parametrize("step", STEPS)
def test_undo_restores_everything(pair, settings, step):
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


@pytest.mark.parametrize("step", ["assign", "new", "forget", "hide", "isolate"])
def test_undo_in_edit_mode_restores_everything(pair, settings, step):
    activate(settings, 0)
    if step == "forget":
        OPS.split_segment()
    choose(pair[0], np.arange(len(pair[0].data.polygons)) < 300)
    bpy.ops.ed.undo_push(message="chosen")
    bpy.ops.object.mode_set(mode="OBJECT")
    before = scene_snapshot()
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.ed.undo_push(message="before")
    run = {
        "assign": OPS.assign_faces, "new": OPS.new_segment, "forget": OPS.forget_faces, "hide": OPS.hide_segment,
        "isolate": OPS.isolate_segment,
    }[step]  # fmt: skip
    assert run() == {"FINISHED"}
    bpy.ops.ed.undo_push(message="after")
    assert bpy.ops.ed.undo() == {"FINISHED"}
    assert bpy.context.mode == "EDIT_MESH"
    bpy.ops.object.mode_set(mode="OBJECT")
    assert not changes(before, {**scene_snapshot(), "active": before["active"]})
