"""The steps of the tutorial, with mouse and keyboard in a real window; each step is checked on the data."""

BODY = "Creature"


def test_tutorial(window, shot):
    untouched = window.ask("contents", BODY)
    window.select(BODY)
    assert window.ask("state")["selected"] == [BODY]
    window.open_sidebar()
    shot("panel")

    window.enter("pose_count", "3")
    window.press("wks_segment.learn")
    window.wait_for("segments", BODY)
    state = window.ask("state")
    assert state["model"]
    assert state["colors"] == "VERTEX", "the viewport does not show the colors"
    assert len(window.ask("segments", BODY)) == 8
    shot("learned")

    window.enter("n_segments", "5")
    window.press("wks_segment.learn")
    window.wait_for("job_is_over")
    assert len(window.ask("segments", BODY)) == 5
    shot("five segments")

    window.press("write_materials")
    window.choose("vertex_groups", "s")
    settings = window.ask("state")["settings"]
    assert (settings["write_materials"], settings["vertex_groups"]) == (True, "soft")
    shot("outputs chosen")
    window.press("wks_segment.apply")
    window.wait_for("groups", BODY, "WKS Segment")
    written = window.ask("contents", BODY)
    assert len(written["slots"]) == 5
    assert len(window.ask("groups", BODY, "WKS Segment")) == 5
    shot("outputs written")

    undone = undo_until(window, untouched)
    assert window.ask("contents", BODY) == untouched, f"after {undone} steps back"
    shot("all undone")
    window.over_viewport()
    window.key(*["ctrl+shift+z"] * undone)
    assert window.ask("contents", BODY) == written
    shot("all done again")

    before = window.ask("state")
    window.key("ctrl+s")
    assert window.ask("state")["saved"]
    window.stop()
    window.start(before["file"])
    after = window.ask("state")
    assert window.ask("contents", BODY) == written
    assert (after["settings"], after["summary"]) == (before["settings"], before["summary"])
    window.open_sidebar()
    shot("opened again")

    window.press("wks_segment.clear")
    cleared = window.ask("contents", BODY)
    assert cleared == untouched
    shot("cleared")
    window.press("wks_segment.apply")
    window.wait_for("segments", BODY)
    assert window.ask("contents", BODY) == written
    shot("applied from the model in the file")


def test_each_output_is_undone_to_the_byte(window, shot):
    window.select(BODY)
    window.open_sidebar()
    window.enter("pose_count", "2")
    window.press("wks_segment.learn")
    window.wait_for("segments", BODY)
    window.wait_for("job_is_over")
    for step, choose in {
        "materials": lambda: window.press("write_materials"),
        "hard groups": lambda: window.choose("vertex_groups", "h"),
        "soft groups": lambda: window.choose("vertex_groups", "s"),
        "no colors": lambda: window.press("write_colors"),
        "sides": lambda: window.choose("sides", "l"),
    }.items():
        before = contents_and_settings(window)
        choose()
        window.press("wks_segment.apply")
        window.wait_for("job_is_over")
        written = contents_and_settings(window)
        assert written[0] != before[0], f"{step}: nothing was written"
        shot(step)
        window.over_viewport()
        undone = 0
        while contents_and_settings(window) != before:
            window.key("ctrl+z")
            undone += 1
            assert undone <= 4, step  # the setting, its consequences, Apply
        window.key(*["ctrl+shift+z"] * undone)
        assert contents_and_settings(window) == written, step


def contents_and_settings(window):
    return window.ask("contents", BODY), window.ask("state")["settings"]


def undo_until(window, contents, at_most=20):
    """Press Ctrl-Z over the viewport until the object is as before; return how often."""
    window.over_viewport()
    for pressed in range(at_most):
        if window.ask("contents", BODY) == contents:
            return pressed
        window.key("ctrl+z")
    return at_most
