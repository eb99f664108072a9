"""The third click of docs/ucupaint.md: the color that Ctrl+C takes from the list is the one that a mask needs."""

import json

BODY = "Creature"

TOLERANCE = 1 / 256
"""Of Ucupaint's masks."""


def test_the_color_of_the_list_is_copied_as_the_mask_needs_it(window, shot):
    window.select(BODY)
    window.open_sidebar()
    window.enter("pose_count", "2")
    window.press("wks_segment.learn")
    window.wait_for("segments", BODY)
    window.wait_for("job_is_over")
    window.press("write_ucupaint")
    written = window.wait_for("color_ids", BODY)
    assert len(written) == len(window.ask("segments", BODY))
    window.move(*window.swatch(0))
    window.key("ctrl+c")
    shot("copied")
    copied = json.loads(window.ask("clipboard"))
    fitting = [color for color in written if all(abs(a - b) < TOLERANCE for a, b in zip(color, copied, strict=False))]
    assert len(fitting) == 1, f"{copied} is none of {written}"
