"""The panel stays where it is: whatever is selected, runs or is said, each button keeps its place."""

import bpy
import numpy as np
import pytest
from builders import limbed, limbed_poses, select
from live_settings import rest
from running_jobs import finish_job

from wks_segment.blender.ui import main_panel, segments_panel
from wks_segment.blender.workflow.background_job import job_holder
from wks_segment.blender.workflow.live_session import session_of

pytestmark = pytest.mark.usefixtures("scene")
OPS = bpy.ops.wks_segment


class Layout:
    """A layout that knows where things are: (top, height) by the name of a button or setting. And texts and icons."""

    def __init__(self, top=0.0, is_row=False, texts=None, icons=None):
        self.texts, self.icons = ([], []) if texts is None else (texts, icons)
        self.top, self.height, self.is_row, self.scale_y = top, 0.0, is_row, 1.0
        self.children, self.places = [], {}

    def _inner(self, is_row):
        self._close()
        child = Layout(self.top if self.is_row else self.top + self.height, is_row, self.texts, self.icons)
        self.children.append(child)
        return child

    def _close(self):
        """Take in what was drawn in the last inner layout."""
        if self.children:
            child = self.children.pop()
            child._close()
            self.places |= child.places
            self._grow(child.height)

    def _grow(self, height):
        self.height = max(self.height, height) if self.is_row else self.height + height * self.scale_y

    def row(self, **_):
        return self._inner(True)

    def column(self, **_):
        return self._inner(False)

    def _leaf(self, name=""):
        self._close()
        self.places[name] = round(self.top + (0 if self.is_row else self.height), 6)
        self._grow(1.0)

    def label(self, text="", **_):
        self._leaf()
        self.texts.append(text)

    def prop(self, owner, name, **_):
        self._leaf(name)

    def progress(self, **_):
        self._leaf()

    def operator(self, name, *_, icon="NONE", **__):
        self._leaf(name)
        self.icons.append(icon)

    operator_menu_enum = operator

    def menu(self, name, **_):
        self._leaf(name)

    def separator(self, **_):
        self._leaf()

    def template_list(self, *_, rows, **__):
        self._leaf("list")
        self._grow(rows)


def drawn(panel):
    """The layout of a panel once it is drawn."""
    layout = Layout()
    panel.draw(type("Shown", (panel.__bases__[0],), {"layout": layout})(), bpy.context)
    layout._close()
    return layout


def places(panel):
    """Where everything in a panel is, and how high it is."""
    layout = drawn(panel)
    return layout.places, round(layout.height, 6)


def main():
    return places(main_panel.WKS_SEGMENT_PT_main)


ALWAYS = ("wks_segment.learn", "wks_segment.apply", "wks_segment.clear", "n_segments", "live", "preview")


def where_all_is():
    found, height = main()
    return {name: found[name] for name in ALWAYS}, height


def test_main_panel_has_one_height_in_every_state(settings, hold_at, learns_anew):
    before = where_all_is()
    one, other = limbed_poses(0.0, 0.4)
    select(one, other)
    assert where_all_is() == before, "something is selected"
    assert OPS.learn() == {"FINISHED"}
    assert where_all_is() == before, "there are segments"
    session = session_of(bpy.context)
    settings.preview = True
    settings.n_segments = 3
    rest(session)
    assert session.proposed is not None
    assert where_all_is() == before, "a preview is shown"
    assert main()[0]["wks_segment.accept"] < main()[0]["wks_segment.learn"]
    OPS.discard()
    session.drop()
    assert where_all_is() == before, "Live sleeps"
    session.tell("Segments are no longer updated, learn or apply again: the mesh was edited in the meantime")
    assert where_all_is() == before, "there is a message of Live"
    settings.source = "FRAMES"
    settings.use_frame_range = True
    assert where_all_is() == before, "there is a range of frames"
    settings.source = "OBJECTS"
    ran, go_on = hold_at("Signature")
    assert where_all_is() == before, "a job runs"
    job_holder(bpy.context).job.stage = 'Signature of "A character with a rather long name, frame 120" (3 of 5)'
    assert where_all_is() == before, "its stage is long"
    OPS.cancel()
    go_on()
    finish_job(ran)
    assert where_all_is() == before, "a job was canceled"


def test_segments_panel_has_one_height_in_every_state(settings):
    def height():
        found, high = places(segments_panel.WKS_SEGMENT_PT_segments)
        return found["list"], found["wks_segment.select_segment"], high

    before = height()
    obj = limbed()
    select(obj)
    OPS.learn()
    assert len(settings.segments) > 1
    assert height() == before
    settings.faces_by_hand = 12
    assert height() == before
    settings.preview = True
    settings.n_segments = 3
    rest(session_of(bpy.context))
    assert session_of(bpy.context).proposed is not None
    assert height() == before
    OPS.discard()
    bpy.ops.object.mode_set(mode="EDIT")
    assert height() == before


def test_a_preview_is_named_as_one(settings):
    """The list is gray and says that it shows what is written, since the viewport shows something else."""
    job_holder(bpy.context).release()
    select(limbed())
    OPS.learn()
    settings.preview = True
    written = len(settings.segments)
    assert drawn(segments_panel.WKS_SEGMENT_PT_segments).texts == [""]
    settings.n_segments = 2
    rest(session_of(bpy.context))
    assert main_panel.status(bpy.context).startswith("Preview in the viewport only")
    assert len(settings.segments) == written > 2
    assert drawn(segments_panel.WKS_SEGMENT_PT_segments).texts == ["These are the written segments"]
    OPS.accept()
    assert len(settings.segments) == 2
    assert drawn(segments_panel.WKS_SEGMENT_PT_segments).texts == [""]


def test_buttons_below_each_other_have_different_icons(settings):
    """Accept and Discard appear instead of Update; Clear and Discard both take back."""
    panels = (main_panel.WKS_SEGMENT_PT_main, main_panel.WKS_SEGMENT_PT_outputs, main_panel.WKS_SEGMENT_PT_bake)
    icons = [icon for panel in panels for icon in drawn(panel).icons]
    assert len(icons) > 8
    assert len(set(icons)) == len(icons)


@pytest.mark.parametrize("materials", [False, True])
def test_outputs_do_not_move(settings, materials):
    before = places(main_panel.WKS_SEGMENT_PT_outputs)
    settings.write_materials = materials
    assert places(main_panel.WKS_SEGMENT_PT_outputs) == before


def test_the_panel_says_whose_segments_it_shows(settings):
    job_holder(bpy.context).release()  # the message of another test
    obj = limbed()
    select(obj)
    OPS.learn()
    row = settings.models[settings.used_model]
    assert row.name == obj.name
    assert main_panel.status(bpy.context) == f'"{obj.name}": segments of the model of this name'
    row.name = model = "Robot"
    assert main_panel.status(bpy.context) == f'"{obj.name}": segments of the model "{model}"'
    OPS.remove_model()
    session_of(bpy.context).drop()
    assert main_panel.status(bpy.context) == f'"{obj.name}": segments without a model'
    other = limbed("Skirt")
    select(obj, other)
    OPS.transfer()
    select(other)
    assert main_panel.status(bpy.context) == '"Skirt": segments transferred from another object'
    assert np.unique([item.number for item in settings.segments]).size > 1
