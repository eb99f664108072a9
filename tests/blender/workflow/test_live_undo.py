"""Undo and redo of labels that follow the settings."""

import bpy
import numpy as np
import pytest
from builders import labels_of, limbed_rigged, select
from live_settings import rest

from wks_segment.blender.operators._base import LabelOperator

pytestmark = pytest.mark.usefixtures("scene")
OPS = bpy.ops.wks_segment


def test_followed_change_is_undone_and_redone_alone(walker, settings, session):
    bpy.ops.ed.undo_push(message="learned")
    name, four = walker.name, labels_of(walker)
    settings.n_segments = 2
    bpy.ops.ed.undo_push(message="the slider")
    rest(session)
    two = labels_of(bpy.data.objects[name])
    assert bpy.ops.ed.undo() == {"FINISHED"}
    np.testing.assert_array_equal(labels_of(bpy.data.objects[name]), four)
    assert bpy.context.scene.wks_segment.n_segments == 4, "the setting stays when its labels go"
    assert session.is_current(bpy.context.scene)
    assert bpy.ops.ed.redo() == {"FINISHED"}
    assert bpy.context.scene.wks_segment.n_segments == 2
    rest(session)
    np.testing.assert_array_equal(labels_of(bpy.data.objects[name]), two)
    assert session.is_current(bpy.context.scene)
    bpy.context.scene.wks_segment.n_segments = 3
    rest(session)
    assert labels_of(bpy.data.objects[name]).max() == 2


def test_undo_keeps_settings_when_live_is_off(walker, settings, session):
    settings.live, settings.n_segments, settings.snap_to = False, 2, {"sharp"}
    bpy.ops.ed.undo_push(message="settings")
    walker.location.x = 1
    bpy.ops.ed.undo_push(message="moved")
    assert bpy.ops.ed.undo() == {"FINISHED"}
    assert bpy.context.scene.wks_segment.n_segments == 2
    assert bpy.context.scene.wks_segment.snap_to == {"sharp"}


def test_undo_of_another_step_keeps_a_refused_number(walker, settings, session):
    settings.preset = "paper"
    assert OPS.learn() == {"FINISHED"}
    settings.n_segments = 3
    rest(session)
    assert "needs a new Learn and Segment" in session.message
    bpy.ops.ed.undo_push(message="the number")
    walker.location.x = 1
    bpy.ops.ed.undo_push(message="moved")
    assert bpy.ops.ed.undo() == {"FINISHED"}
    assert bpy.context.scene.wks_segment.n_segments == 3
    assert "needs a new Learn and Segment" in session.message


def test_discarded_preview_restores_settings_after_undo(walker, settings, session):
    bpy.ops.ed.undo_push(message="learned")
    settings.n_segments = 2
    bpy.ops.ed.undo_push(message="the slider")
    rest(session)
    assert bpy.ops.ed.undo() == {"FINISHED"}
    settings = bpy.context.scene.wks_segment
    settings.preview, settings.n_segments = True, 3
    rest(session)
    session.discard(bpy.context.scene)
    assert settings.n_segments == 4


def test_update_is_offered_after_redo_if_labels_do_not_follow(walker, settings, session):
    bpy.ops.ed.undo_push(message="learned")
    settings.live, settings.n_segments = False, 2
    bpy.ops.ed.undo_push(message="the slider")
    bpy.ops.ed.undo()
    assert session.is_current(bpy.context.scene)
    bpy.ops.ed.redo()
    assert not session.is_current(bpy.context.scene)
    assert not session.is_scheduled
    assert OPS.update.poll()


def test_labels_do_not_follow_after_undo_of_learning(session, settings):
    obj = limbed_rigged()
    select(obj)
    settings.source, settings.pose_count = "FRAMES", 2
    bpy.ops.ed.undo_push(message="before")
    assert OPS.learn("EXEC_DEFAULT", True) == {"FINISHED"}
    bpy.ops.ed.undo()
    settings = bpy.context.scene.wks_segment
    settings.n_segments = 2
    assert rest(session) is None
    assert "wks_segment" not in bpy.data.objects["Walker"].data.attributes
    assert not OPS.update.poll()


def test_adjusting_learn_does_not_learn_again(session, settings, fits, monkeypatch):
    # Blender's own undo_redo crashes without a window: what it does is undo, and call again with a flag.
    obj = limbed_rigged()
    select(obj)
    settings.source, settings.pose_count = "FRAMES", 2
    bpy.ops.ed.undo_push(message="before")
    assert OPS.learn("EXEC_DEFAULT", True) == {"FINISHED"}
    assert fits == {"fit": 1, "describe": 2}
    last = bpy.context.window_manager.operators[-1]
    assert last.bl_idname == "WKS_SEGMENT_OT_learn"
    assert (last.n_segments, last.auto_segments, last.sides) == (4, False, "one")
    bpy.ops.ed.undo()
    monkeypatch.setattr(LabelOperator, "is_adjusted", True)
    assert OPS.learn("EXEC_DEFAULT", True, n_segments=2) == {"FINISHED"}
    assert set(labels_of(bpy.data.objects["Walker"])) == {0, 1}
    assert bpy.context.scene.wks_segment.n_segments == 2
    assert fits == {"fit": 1, "describe": 2}


def test_operator_takes_given_settings_and_others_from_the_scene(walker, settings):
    settings.smoothness = 0.5
    assert OPS.learn(n_segments=3) == {"FINISHED"}
    assert settings.n_segments == 3
    assert settings.smoothness == 0.5
    assert labels_of(walker).max() == 2
