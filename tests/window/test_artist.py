"""Work of an artist with segments: the list, adjusting, outputs, and the way from the ZIP to a baked ID map."""

import pytest

BODY = "Creature"
MAX_CLICKS_TO_COLORS, MAX_CLICKS = 6, 10
"""Largest numbers of clicks from the ZIP to the first colored character, and to a baked ID map."""

EMPTY_COLOR = "0 0 0 255"
"""Color of pixels that no face covers."""
SEGMENTS, SMOOTHNESS = 0, 3
"""Indices of fields in the panel that adjusts Learn and Segment."""


@pytest.fixture
def learned(window):
    """The window after learning from two poses."""
    window.select(BODY)
    window.open_sidebar()
    window.enter("pose_count", "2")
    window.press("wks_segment.learn")
    window.wait_for("segments", BODY)
    window.wait_for("job_is_over")
    return window


def test_segments_are_renamed_hidden_split_selected_and_assigned_in_the_list(learned, shot):
    names = [row[0] for row in learned.ask("rows")]
    assert names == [f"Segment {i}" for i in range(1, 9)]
    rename(learned, 1, "Torso")
    assert [row[0] for row in learned.ask("rows")][:3] == ["Segment 1", "Torso", "Segment 3"]
    shot("renamed")

    learned.click(*learned.row(0))
    before = learned.ask("segments", BODY)
    rows = learned.ask("rows")
    split = next(i for i in range(len(rows)) if can_be_split(learned, i))
    assert len(learned.ask("segments", BODY)) > len(before)
    shot(f"row {split + 1} split")
    learned.over_viewport()
    learned.key("ctrl+z")
    assert learned.ask("segments", BODY) == before

    learned.click(*learned.row(2))
    learned.press("wks_segment.select_segment")
    assert learned.ask("state")["selected"] == [BODY]
    chosen = [row[3] for row in learned.ask("rows")]
    assert chosen[2] > 0
    assert sum(chosen) == chosen[2]
    shot("selected in edit mode")
    learned.press("wks_segment.hide_segment")  # the eye of the first row
    assert [row[2] for row in learned.ask("rows")] == [True] + 7 * [False]
    shot("hidden")
    learned.press("wks_segment.hide_segment")
    assert not any(row[2] for row in learned.ask("rows"))
    learned.click(*learned.row(0))
    learned.press("wks_segment.assign_faces")
    learned.over_viewport()
    learned.key("Tab")
    after = learned.ask("segments", BODY)
    assert "2" not in after
    assert after["0"] == before["0"] + before["2"]
    shot("assigned by hand")


def can_be_split(window, index):
    before = window.ask("segments", BODY)
    window.click(*window.row(index))
    window.press("wks_segment.split_segment")
    return window.ask("segments", BODY) != before


def rename(window, index, name):
    window.click(*window.row(index), repeat=2)
    window.key("ctrl+a")
    window.type(name)
    window.key("Return")


def test_the_last_operation_is_adjusted_without_learning_again(learned, shot):
    learned.adjust(SEGMENTS, "5")
    learned.wait_for("n_segments", BODY, 5)
    shot("five segments")
    before = learned.ask("contents", BODY)
    learned.adjust(SMOOTHNESS, "0")
    learned.settle()
    assert learned.ask("contents", BODY) != before
    shot("not smooth")
    learned.adjust(SMOOTHNESS, "1")
    learned.settle()
    assert learned.ask("contents", BODY) == before


def test_a_preview_writes_nothing_until_it_is_accepted(learned, shot):
    before = learned.ask("contents", BODY)
    learned.press("preview")
    learned.enter("n_segments", "4")
    learned.find("wks_segment.accept")
    assert learned.ask("contents", BODY) == before
    shot("previewed")
    learned.press("wks_segment.discard")
    assert learned.ask("contents", BODY) == before
    assert learned.ask("state")["settings"]["n_segments"] == 8
    shot("discarded")
    learned.enter("n_segments", "4")
    learned.press("wks_segment.accept")
    learned.wait_for("n_segments", BODY, 4)
    shot("accepted")


def test_from_the_zip_to_a_baked_id_map(window, shot):
    # Installing the ZIP takes three clicks in Blender's own windows (Install from Disk, the file, the button).
    clicks = window.clicks + 3
    window.select(BODY)
    window.open_sidebar()
    window.press("wks_segment.learn")
    window.wait_for("segments", BODY)
    window.wait_for("job_is_over")
    assert clicks + window.clicks <= MAX_CLICKS_TO_COLORS
    shot("colored")
    window.press("bake_unwrap")  # the creature has no UV map
    window.press("wks_segment.bake")
    colors = window.wait_for("image_colors", f"{BODY} ID Map")
    shot("baked")
    assert clicks + window.clicks <= MAX_CLICKS
    # Only the flat colors of eight segments, and black: no mixed colors.
    assert colors.pop(EMPTY_COLOR) > 0
    assert 2 <= len(colors) <= 8


def test_outputs_are_written_and_undone(learned, shot):
    before = learned.ask("contents", BODY)
    learned.press("write_seams")
    learned.press("write_face_sets")
    learned.press("wks_segment.apply")
    learned.wait_for("job_is_over")
    assert learned.ask("contents", BODY)["seams"] > before["seams"]
    assert learned.ask("face_sets", BODY) == 8
    shot("seams and face sets")
    for button, is_written in {
        "wks_segment.unwrap": lambda now: len(now["uv layers"]) > len(before["uv layers"]),
        "wks_segment.separate": lambda now: len(now["objects"]) > len(before["objects"]),
    }.items():
        last = learned.ask("contents", BODY)
        learned.press(button)
        assert is_written(learned.ask("contents", BODY)), button
        shot(button.rpartition(".")[2])
        learned.over_viewport()
        learned.key("ctrl+z")
        assert learned.ask("contents", BODY) == last, button
    learned.press("wks_segment.clear")
    cleared = learned.ask("contents", BODY)
    assert cleared["seams"] == 0
    assert not [name for name in cleared if name.startswith("attribute wks_segment")]
    shot("cleared")


def test_an_outfit_takes_the_segments_of_the_body(learned, shot):
    """A copy of the body without segments serves as the outfit."""
    learned.over_viewport()
    learned.key("shift+d", "Escape")
    copy = next(name for name in learned.ask("objects") if name.startswith(f"{BODY}."))
    learned.press("wks_segment.clear")
    assert learned.ask("segments", copy) == {}
    learned.over_viewport()
    learned.key("a")
    learned.ask("make_active", BODY)
    learned.press("wks_segment.transfer")
    assert learned.ask("segments", copy).keys() == learned.ask("segments", BODY).keys()
    shot("transferred")
