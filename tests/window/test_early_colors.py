"""First colors: parts in the viewport while the job still learns, and nothing of them in the file."""

import numpy as np
import pytest
from PIL import Image

BODY = "Creature"
COLORED, FEW = 20_000, 2_000
"""Least number of pixels that parts color, and most by which the number without parts differs: an outline, a gizmo."""


@pytest.fixture
def colored(window, tmp_path):
    """A function that counts the pixels of the 3D viewport, beside its side panel, that are colored."""

    def count():
        x, y, width, height = window.ask("region", "WINDOW")
        across = window.ask("region", "UI")[0] - x
        window.screenshot(tmp_path / "now.png", (x, y, min(across, width), height))
        pixels = np.asarray(Image.open(tmp_path / "now.png").convert("RGB"), dtype=int)
        return int(np.count_nonzero(np.ptp(pixels, axis=2) > 70))

    return count


def test_first_colors_come_before_the_job_ends(window, shot, colored):
    window.select(BODY)
    window.open_sidebar()
    window.enter("pose_count", "5")
    window.ask("subdivide", BODY)
    before = window.ask("contents", BODY)
    plain = colored()
    window.press("wks_segment.learn")
    window.wait_for("first_colors", timeout=120)
    window.settle()
    shot("first colors")
    assert colored() > plain + COLORED
    assert window.ask("job_runs"), "the job ended before the first colors were seen"
    assert window.ask("contents", BODY) == before
    window.over_viewport()
    window.key("Escape")
    window.wait_for("job_is_over", timeout=60)
    window.settle()
    shot("canceled")
    assert abs(colored() - plain) < FEW
    assert window.ask("contents", BODY) == before
    window.press("wks_segment.learn")
    window.wait_for("segments", BODY)
    window.settle()
    shot("learned")
    assert not window.ask("first_colors")
    assert colored() > plain + COLORED
    window.over_viewport()
    window.key("ctrl+z")
    window.settle()
    assert window.ask("contents", BODY) == before, "one step of undo takes all back"
