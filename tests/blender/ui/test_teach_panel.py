"""The panel My Parts: what it shows for each source of parts, and the rows of the tree of bones."""

from types import SimpleNamespace
from unittest.mock import MagicMock

import bpy
import pytest
from builders import limbed_rigged, select

from wks_segment.blender.ui import main_panel, models_panel, teach_panel

pytestmark = pytest.mark.usefixtures("scene")
ICONS = {item.identifier for item in bpy.types.UILayout.bl_rna.functions["prop"].parameters["icon"].enum_items}


class Seen:
    """A layout that keeps the names of settings and operators, and refuses icons that Blender does not have."""

    def __init__(self):
        self.names, self.texts = [], []

    def __getattr__(self, name):
        return lambda *_, **given: self

    def __setattr__(self, name, value):
        object.__setattr__(self, name, value)

    def _keep(self, name, given):
        assert given.get("icon", "NONE") in ICONS
        self.names.append(name)

    def prop(self, owner, name, **given):
        assert hasattr(owner, name)
        self._keep(name, given)

    def operator(self, name, **given):
        self._keep(name, given)
        return MagicMock()

    def label(self, text="", **given):
        self._keep("label", given)
        self.texts.append(text)

    def template_list(self, list_type, _, owner, items, active_owner, active, **given):
        assert hasattr(bpy.types, list_type)
        assert hasattr(owner, items)
        assert hasattr(active_owner, active)
        self._keep(items, given)


def drawn(panel):
    """What a panel draws."""
    stand_in = SimpleNamespace(layout=Seen())
    stand_in.settings = lambda context, *names: panel.settings(stand_in, context, *names)
    panel.draw(stand_in, bpy.context)
    return stand_in.layout


@pytest.mark.parametrize(
    ("source", "shown"),
    [
        ("BONES", {"usual_parts", "bone_parts", "wks_segment.list_bones"}),
        ("FACE_SETS", {"all_face_sets"}),
        ("MATERIALS", set()),
    ],
)
def test_what_a_source_needs_is_shown(settings, source, shown):
    settings.parts_from = source
    always = {"parts_from", "taught_sides", "unlabeled", "wks_segment.teach"}
    assert set(drawn(teach_panel.WKS_SEGMENT_PT_teach).names) == always | shown


def test_the_tree_is_shown_once_bones_are_listed(settings):
    select(limbed_rigged())
    bpy.ops.wks_segment.list_bones()
    assert "bones" in drawn(teach_panel.WKS_SEGMENT_PT_teach).names
    rows = []
    for item in settings.bones:
        layout = Seen()
        teach_panel.WKS_SEGMENT_UL_bones.draw_item(None, bpy.context, layout, settings, item, 0, settings)
        rows.append((layout.names, [text for text in layout.texts if text]))
    assert rows[0][0][0] == "open", "the first row has rows below it"
    assert "own" not in rows[0][0], "the first row is always a part"
    assert rows[1][0][:2] == ["label", "own"]
    assert [texts[0] for _, texts in rows] == ["Torso", "Limb"]
    assert [texts[1].endswith(" %") for _, texts in rows] == [True, True]


def test_the_ranking_says_what_does_not_fit(settings):
    item = settings.ranking.add()
    item.name, item.fits = "Human", False
    layout = Seen()
    models_panel.draw_ranking(layout, settings)
    assert layout.texts == ["Human", "does not fit"]


def test_the_button_for_named_parts_is_in_the_main_panel(settings):
    stand_in = SimpleNamespace(layout=Seen())
    for name in ("settings", "segments", "frame_range", "live", "status"):
        setattr(stand_in, name, lambda context, *names: settings)
    main_panel.WKS_SEGMENT_PT_main.draw(stand_in, bpy.context)
    assert "wks_segment.name_parts" in stand_in.layout.names
