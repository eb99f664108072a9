"""Left and Right that does nothing says so, wherever it was chosen; left is told by the bones and the mesh."""

import bpy
import numpy as np
import pytest
from builders import labels_of, limbed, select
from live_settings import rest

from wks_segment.blender.cli import creature as builder
from wks_segment.blender.ui.main_panel import status
from wks_segment.blender.workflow.background_job import job_holder

pytestmark = pytest.mark.usefixtures("scene")
OPS = bpy.ops.wks_segment
NOTHING_DONE = "No segment has parts on both sides"


@pytest.fixture
def lopsided(settings, session):
    """A learned object that has no mirror plane."""
    job_holder(bpy.context).release()  # the message of another test
    obj = limbed()
    select(obj)
    OPS.learn()
    return obj


def test_it_is_said_in_the_status_bar_and_in_the_panel(lopsided, settings, printed):
    settings.live = False
    settings.sides = "two"
    printed()
    OPS.update()
    assert f"Warning: {NOTHING_DONE}" in printed().out
    assert status(bpy.context).startswith(NOTHING_DONE)
    OPS.apply()
    assert f"Warning: {NOTHING_DONE}" in printed().out


@pytest.mark.parametrize("preview", [False, True])
def test_it_is_said_in_the_panel_under_live(lopsided, settings, session, preview):
    settings.preview = preview
    before = labels_of(lopsided)
    settings.sides = "two"
    rest(session)
    assert status(bpy.context).startswith(NOTHING_DONE)
    np.testing.assert_array_equal(labels_of(lopsided), before)
    settings.sides = "one"
    rest(session)
    assert NOTHING_DONE not in status(bpy.context), "it goes away with its reason"


@pytest.mark.parametrize(("names", "left"), [("as they are", 1), ("swapped", 2)])
def test_left_is_where_the_names_of_the_bones_say(settings, monkeypatch, names, left):
    """The mirror plane is that of the mesh; which side of it is left, the bones say, not the axes of the object."""
    monkeypatch.setattr(builder, "SUBDIVISIONS", 1)
    obj = builder.build_creature(bpy.context.scene)
    rig = obj.parent
    if names == "swapped":
        for bone in rig.data.bones:
            if bone.name.endswith((".L", ".R")):
                bone.name = f"{bone.name[:-2]}.{'?' if bone.name.endswith('.L') else '!'}"
        for bone in rig.data.bones:
            if bone.name[-1] in "?!":
                bone.name = f"{bone.name[:-2]}.{'R' if bone.name[-1] == '?' else 'L'}"
    settings.source, settings.pose_count, settings.sides = "FRAMES", 2, "two"
    settings.n_segments, settings.n_eigenpairs = 6, 60
    select(obj)
    assert OPS.learn() == {"FINISHED"}
    x = np.array([polygon.center.x for polygon in obj.data.polygons])
    sides = labels_of(obj) // 1000
    assert set(sides) == {0, 1, 2}
    assert (x[sides == left] > 0).all()
    assert (x[sides == 3 - left] < 0).all()
