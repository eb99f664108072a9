"""The docs name every setting and every button of the panel, and give the defaults that it has."""

import re
from pathlib import Path

import pytest

from wks_segment.blender import registration
from wks_segment.blender.props.settings import WKSSegmentSettings

pytestmark = pytest.mark.usefixtures("scene")
ROOT = Path(__file__).resolve().parents[3]
PARAMETERS = (ROOT / "docs" / "parameters.md").read_text(encoding="utf-8")
PAGES = "\n".join(
    path.read_text(encoding="utf-8") for path in (ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")))
)
IN_LISTS = {"segments", "active_segment", "models", "active_model", "ranking", "bones", "active_bone"}
"""Properties that the lists show, not fields."""
IN_A_ROW = {"First", "Last", "Automatic", "Template"}
"""Settings that the docs describe with the one that they belong to, by another word or on another page."""
BY_OTHER_WORDS = {
    "Hide or Show Segment", "Isolate Segment", "Show All Segments", "Name Segment", "Refresh List of Segments",
    "Cancel", "Use Model", "Duplicate Model", "Remove Model", "Apply Ranked Model", "Add Settings Preset",
}  # fmt: skip
"""Operators whose buttons are icons or show another text."""
FORMER = ("Merge Segment", "Split Segment", "Assign Faces", "New Segment", "Forget Faces", "Restore Segments")
"""Operators whose buttons show the first word of their names only."""


def settings_of_the_panel():
    return [
        found for found in WKSSegmentSettings.bl_rna.properties
        if found.identifier not in {*IN_LISTS, "rna_type", "name"} and not found.is_hidden
    ]  # fmt: skip


def test_every_setting_is_on_the_page_of_parameters():
    shown = re.sub(r"\s+", " ", PARAMETERS)
    names = {found.name for found in settings_of_the_panel()} - IN_A_ROW
    assert {name for name in names if f"*{name}*" not in shown and f"## {name} " not in shown} == set()


def test_the_page_gives_the_defaults_of_the_panel():
    """As far as a section has one."""
    settings = {found.name: found for found in settings_of_the_panel()}
    given = dict(re.findall(r"^## (.+)\n\*\(.*?default ([^)]+)\)\*", PARAMETERS, re.MULTILINE))
    assert len(given) >= 7
    for name, text in given.items():
        found = settings[name]
        default = found.default if found.type != "ENUM" else found.enum_items[found.default].identifier
        assert text.removesuffix(" %") == (f"{default:g}" if isinstance(default, int | float) else default), name


def test_every_button_is_in_the_docs():
    shown = re.sub(r"\s+", " ", PAGES)
    for operator in registration.OPERATORS:
        name = operator.bl_label
        if name not in BY_OTHER_WORDS:
            name = name.split()[0] if name.startswith(FORMER) else name.removesuffix(" Model")
            assert re.search(rf"\*{re.escape(name)}\b", shown), operator.bl_label
