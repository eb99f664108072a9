"""The tour of an artist: two characters in one scene, each output, each undone and done again.

What was clicked and how long it took is written to `window/TEST VERSION.md`.
"""

import time

import pytest
from conftest import ROOT

LARGE, SMALL = "Creature", "Calf"
MAX_UNDONE = 3
"""Most steps of undo that a step of the tour may take: two where a field and a button are used."""
PALETTES = ("Maximally Different", "Color-Blind Safe", "Different (Old)")
"""Palettes below the one that is in use at first, in the order of the menu."""


class Tour:
    """Takes the steps, checks each on the data, and writes the table."""

    def __init__(self, window, shot, name):
        self.window, self.shot, self.lines = window, shot, []
        self._path = ROOT / "window" / f"{name} {window.version}.md"

    def everything(self):
        """What an artist could lose or see change: both characters, fields, list and images."""
        ask = self.window.ask
        return {
            LARGE: {key: value for key, value in ask("contents", LARGE).items() if key != "objects"},
            SMALL: ask("contents", SMALL),
            "settings": ask("state")["settings"],
            "list": [[name, round(share, 3), hidden] for name, share, hidden, _ in ask("rows")],
            "images": ask("images"),
            "face sets": {name: ask("face_sets", name) for name in (LARGE, SMALL)},
        }

    def step(self, name, *, clicks, changes, places=(), wait=None):
        """Take a step; it must change what it is for, and of the small character only; undo and redo restore all."""
        window = self.window
        for place in places:
            window.find(place)  # a user sees it at once
        before, counted, begun = self.everything(), window.clicks, time.monotonic()
        clicks()
        window.wait_for("job_is_over")
        if wait is not None:
            window.wait_for(*wait, timeout=120)
        window.settle()
        seconds, counted = time.monotonic() - begun, window.clicks - counted
        after = self.everything()
        assert changes(before[SMALL], after[SMALL]) if callable(changes) else after[changes] != before[changes], name
        assert after[LARGE] == before[LARGE], f"{name}: the other character has changed"
        self.shot(name)
        window.over_viewport()
        undone = 0
        while self.everything() != before:
            window.key("ctrl+z")
            undone += 1
            assert undone <= MAX_UNDONE, f"{name}: {differences(before, self.everything())} differ after undo"
        window.key(*["ctrl+shift+z"] * undone)
        window.settle()
        assert self.everything() == after, f"{name}: {differences(after, self.everything())} differ after redo"
        self.lines.append(f"| {name} | {counted} | {seconds:.1f} | {undone} |")
        self.save()

    def save(self):
        """Write the table as far as it is."""
        head = [f"Blender {self.window.version}", "", "| step | clicks | seconds | undo steps |", "|---|---|---|---|"]
        self._path.write_text("\n".join([*head, *self.lines, ""]), encoding="utf-8")


def differences(first, second):
    return {
        key: [each for each in first[key] if first[key][each] != second[key].get(each)]
        if isinstance(first[key], dict) else True
        for key in first if first[key] != second[key]
    }  # fmt: skip


def new(key):
    """Whether an attribute or a property is there that was not."""
    return lambda before, after: key in after and key not in before


def differs(key):
    return lambda before, after: before[key] != after[key]


@pytest.fixture
def tour(pair, shot, request):
    """The window with the large character learned, and the small one selected."""
    pair.select(LARGE)
    pair.open_sidebar()
    pair.enter("pose_count", "2")
    pair.press("wks_segment.learn")
    pair.wait_for("segments", LARGE)
    pair.wait_for("job_is_over")
    pair.select(SMALL)
    return Tour(pair, shot, request.node.originalname)


LABELS, COLORS = "attribute wks_segment", "attribute wks_segment_color"


def press(window, name):
    return {"places": [name], "clicks": lambda: window.press(name)}


def choose(window, name, *keys):
    return {"places": [name], "clicks": lambda: window.choose(name, *keys)}


@pytest.mark.timeout(3600)
def test_tour_of_the_panel(tour):
    window, step = tour.window, tour.step
    step("Learn and Segment", **press(window, "wks_segment.learn"), changes=new(LABELS))
    step("Smoothness", places=["smoothness"], clicks=lambda: window.enter("smoothness", "0"), changes=differs(LABELS))
    step("Segments 5", places=["n_segments"], clicks=lambda: window.enter("n_segments", "5"),
         wait=("n_segments", SMALL, 5), changes=differs(LABELS))  # fmt: skip
    step("Left and Right", **choose(window, "sides", "l"), changes=differs(LABELS))
    step("Merge", places=["active_segment", "wks_segment.split_segment"], clicks=lambda: window.merge(1, into=0),
         changes=differs(LABELS))  # fmt: skip

    step("Find Named Parts", **press(window, "wks_segment.name_parts"), changes=differs(LABELS))


@pytest.mark.timeout(3600)
def test_tour_of_the_outputs(tour):
    window, step = tour.window, tour.step
    window.press("wks_segment.learn")
    window.wait_for("segments", SMALL)
    window.wait_for("job_is_over")
    for number, name in enumerate(PALETTES, 2):
        step(f"Palette {name}", **choose(window, "palette", *["Down"] * number, "Return"), changes=differs(COLORS))
    step("Ucupaint", **press(window, "write_ucupaint"), changes=new("attribute __yp_color_id"))
    step("Materials", **press(window, "write_materials"), changes=differs("slots"))
    for kind in ("hard", "soft"):
        step(f"Vertex Groups, {kind}", **choose(window, "vertex_groups", kind[0]), changes=differs("weights"))
    step("Face Sets", **press(window, "write_face_sets"), changes="face sets")
    step("Seams", **press(window, "write_seams"), changes=differs("seams"))
    step("no Colors", **press(window, "write_colors"), changes=differs("shown colors"))
    step("Colors", **press(window, "write_colors"), changes=differs("shown colors"))
    step("Unwrap Segments", **press(window, "wks_segment.unwrap"), changes=differs("uv layers"))
    step("Bake ID Map", **press(window, "wks_segment.bake"), changes="images")
    step("Separate by Segments", **press(window, "wks_segment.separate"), changes=differs("objects"))
    step(
        "Clear",
        **press(window, "wks_segment.clear"),
        changes=lambda before, after: LABELS in before and LABELS not in after,
    )
    step("Apply to Selected", **press(window, "wks_segment.apply"), changes=new(LABELS))
