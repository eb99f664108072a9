"""Work of an artist on what was made for segments stays, and the right one of several characters is learned."""

import pytest

BODY, RIG = "Creature", "Creature rig"
ARTIST = "Velvet"


@pytest.fixture
def learned(window):
    """The window after learning from two poses."""
    window.select(BODY)
    learn(window, BODY)
    return window


def learn(window, name):
    window.open_sidebar()
    window.enter("pose_count", "2")
    window.press("wks_segment.learn")
    window.wait_for("segments", name)
    window.wait_for("job_is_over")


def test_a_separated_object_that_was_worked_on_stays(learned, shot):
    learned.press("wks_segment.separate")
    separated = learned.ask("objects")
    assert len(separated) == 10
    learned.select("Segment 2")
    (piece,) = learned.ask("state")["selected"]
    learned.over_viewport()
    learned.key("Tab", "a", "ctrl+e", "m", "Tab")  # the menu of edges: Mark Seam
    worked_on = learned.ask("contents", piece)
    assert worked_on["seams"] > 0
    learned.over_viewport()
    learned.key("a")
    shot("worked on")

    learned.press("wks_segment.clear")
    shot("asked first, as objects are removed")
    learned.key("Return")
    assert learned.ask("objects").keys() == {BODY, RIG, piece}
    cleared = learned.ask("contents", piece)
    assert cleared["seams"] == worked_on["seams"]
    assert learned.ask("state")["colors"] == "MATERIAL"
    shot("cleared")
    learned.over_viewport()
    learned.key("ctrl+z")
    assert learned.ask("objects") == separated
    assert learned.ask("contents", piece) == worked_on
    assert learned.ask("state")["colors"] == "VERTEX"
    shot("undone")
    learned.key("ctrl+shift+z")
    assert learned.ask("contents", piece) == cleared
    assert learned.ask("state")["colors"] == "MATERIAL"
    shot("done again")


def test_an_edited_material_stays(learned, shot):
    learned.press("write_materials")
    learned.press("wks_segment.apply")
    learned.wait_for("job_is_over")
    learned.ask("edit_material", "Segment 1", 0.75, ARTIST)
    for step, number in (("live", "6"), ("back", "8")):
        learned.enter("n_segments", number)
        learned.wait_for("n_segments", BODY, int(number))
        assert learned.ask("materials")[ARTIST] == 0.75
        assert ARTIST in learned.ask("contents", BODY)["slots"]
        shot(step)
    learned.press("wks_segment.apply")
    learned.wait_for("job_is_over")
    assert learned.ask("materials")[ARTIST] == 0.75
    shot("applied")
    learned.press("wks_segment.clear")
    assert learned.ask("contents", BODY)["slots"] == []
    assert learned.ask("materials")[ARTIST] == 0.75
    assert not [name for name in learned.ask("materials") if name.startswith("Segment")]
    shot("cleared")


def test_the_larger_of_two_characters_is_learned_unless_the_other_is_active(pair, shot):
    pair.over_viewport()
    pair.key("a")
    pair.ask("make_active", "Ground")
    learn(pair, BODY)
    told = "\n".join(pair.ask("state")["summary"])
    assert told.startswith(f"From {BODY}")
    assert 'do not move: "Ground"' in told
    assert 'Several characters move: "Calf", "Creature"' in told
    assert pair.ask("segments", "Calf") == pair.ask("segments", "Ground") == {}
    shot("the larger one")
    pair.ask("make_active", "Calf")
    learn(pair, "Calf")
    assert pair.ask("state")["summary"][0] == "From Calf"
    assert len(pair.ask("segments", "Calf")) == 8
    shot("the active one")
