"""Work that does not block the window: progress, orbiting, canceling, and what ends a job by itself."""

import pytest

BODY = "Creature"


@pytest.fixture
def learning(window):
    """The window while the creature is learned."""
    window.select(BODY)
    window.open_sidebar()
    window.press("wks_segment.learn")
    window.wait_for("job_runs", patience=20)
    return window


def test_progress_is_shown_and_the_view_stays_orbitable(learning, shot):
    shot("learning")
    before = learning.ask("view")
    x, y, width, height = learning.ask("region", "WINDOW")
    learning.drag(x + width // 3, y + height - 60, x + width // 3 + 150, y + height - 90, button=2)
    assert learning.ask("job_runs"), "too quick to tell"
    assert learning.ask("view") != before
    shot("orbited meanwhile")
    learning.wait_for("job_is_over")
    assert len(learning.ask("segments", BODY)) == 8
    learning.settle()
    shot("learned")


@pytest.mark.parametrize("how", ["escape", "button"])
def test_canceling_writes_nothing_and_one_can_learn_again(learning, shot, how):
    before = learning.ask("contents", BODY)
    if how == "escape":
        learning.over_viewport()
        learning.key("Escape")
    else:
        learning.press("wks_segment.cancel")
    learning.wait_for("job_is_over", patience=30)
    shot(f"canceled by {how}")
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
    learning.wait_for("job_is_over", patience=30)
    learning.settle()
    shot("deleted")
    assert not learning.ask("state")["model"]


def test_editing_the_mesh_ends_the_job(learning, shot):
    learning.over_viewport()
    learning.key("Tab", "a", "x", "v")
    learning.wait_for("job_is_over", patience=30)
    learning.key("Tab")
    shot("edited")
    assert learning.ask("segments", BODY) == {}


def test_leaving_the_file_ends_the_job(learning, shot):
    learning.over_viewport()
    learning.key("ctrl+n", "Return")
    learning.settle()
    shot("asked to save")
    learning.key("d")  # Don't Save
    learning.wait_for("job_is_over", patience=30)
    learning.settle()
    shot("new file")
    assert learning.ask("state")["file"] == ""
