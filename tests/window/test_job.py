"""A job that runs in the background: progress, orbiting meanwhile, canceling, and changes that end it."""

import pytest

BODY = "Creature"


@pytest.fixture
def learning(window):
    """The window while the creature is learned."""
    window.select(BODY)
    window.open_sidebar()
    window.press("wks_segment.learn")
    window.wait_for("job_runs", timeout=20)
    return window


def test_progress_is_shown_and_the_view_stays_orbitable(learning, shot):
    shot("learning")
    before = learning.ask("view")
    x, y, width, height = learning.ask("region", "WINDOW")
    learning.drag(x + width // 3, y + height - 60, x + width // 3 + 150, y + height - 90, button=2)
    assert learning.ask("job_runs"), "the job ended before the view could be moved"
    assert learning.ask("view") != before
    shot("orbited meanwhile")
    learning.wait_for("job_is_over")
    assert len(learning.ask("segments", BODY)) == 8
    learning.settle()
    shot("learned")


@pytest.mark.parametrize("means", ["escape", "button"])
def test_canceling_writes_nothing_and_one_can_learn_again(learning, shot, means):
    before = learning.ask("contents", BODY)
    if means == "escape":
        learning.over_viewport()
        learning.key("Escape")
    else:
        learning.press("wks_segment.cancel")
    learning.wait_for("job_is_over", timeout=30)
    shot(f"canceled by {means}")
    assert learning.ask("contents", BODY) == before
    assert not learning.ask("state")["model"]
    learning.enter("pose_count", "2")
    learning.press("wks_segment.learn")
    learning.wait_for("segments", BODY)
    shot("learned again")


def test_deleting_the_object_ends_the_job(learning, shot):
    learning.over_viewport()
    learning.key("x")
    learning.key("Return")
    learning.wait_for("job_is_over", timeout=30)
    learning.settle()
    shot("deleted")
    assert not learning.ask("state")["model"]


def test_editing_the_mesh_ends_the_job(learning, shot):
    learning.over_viewport()
    learning.key("Tab", "a", "x", "v")
    learning.wait_for("job_is_over", timeout=30)
    learning.key("Tab")
    shot("edited")
    assert learning.ask("segments", BODY) == {}


def test_leaving_the_file_ends_the_job(learning, shot):
    learning.over_viewport()
    learning.key("ctrl+n", "Return")
    learning.settle()
    shot("asked to save")
    learning.key("d")  # Don't Save
    learning.wait_for("job_is_over", timeout=30)
    learning.settle()
    shot("new file")
    assert learning.ask("state")["file"] == ""
