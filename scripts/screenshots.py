"""Take the screenshots of the docs that show Blender's window, to `docs/images`: `make screenshots`.

Opens a real Blender with the current extension, and follows the steps of the docs with mouse and keyboard. Blender is
taken from the folder that WKS_SEGMENT_WINDOW names, or installed there; `tests/window` says what that needs.
"""

from __future__ import annotations

import argparse
import os
import tempfile
from pathlib import Path

from tests.window.driver import SUITES, RealBlender, build_zip

IMAGES = Path(__file__).resolve().parent.parent / "docs" / "images"
BODY = "Creature"
LAST_OUTPUT = "wks_segment.transfer"
"""The lowest button of *Outputs* above a menu, which Blender tells no name of."""
MARGIN_BELOW = 91
"""Pixels below that button, which show the menu and the titles of closed sub-panels."""


def main() -> None:
    """Take all screenshots."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--blender", choices=SUITES, default="5.2")
    parser.add_argument("--output", type=Path, default=IMAGES)
    options = parser.parse_args()
    folder = Path(os.environ.get("WKS_SEGMENT_WINDOW", "window"))
    with tempfile.TemporaryDirectory() as temporary, RealBlender(options.blender, folder) as blender:
        blender.install_extension(build_zip(Path(temporary)))
        blender.start(blender.make_scene("creature", "creature.blend"))
        blender.ask("zoom_to_all")
        take(blender, options.output)


def take(blender: RealBlender, folder: Path) -> None:
    """Learn from a character as in the docs, with a picture of the window and one of the panel with its outputs."""
    blender.select(BODY)
    blender.open_sidebar()
    blender.press("wks_segment.learn")
    blender.wait_for("segments", BODY)
    blender.wait_for("job_is_over")
    picture(blender, folder / "panel.png", blender.ask("region", "WINDOW"))
    blender.find("write_materials")  # opens its sub-panel
    x, y, width, height = blender.ask("region", "UI")
    _, last = blender.find(LAST_OUTPUT)
    picture(blender, folder / "panel_outputs.png", [x, y, width, min(height, last - y + MARGIN_BELOW)])


def picture(blender: RealBlender, path: Path, box: list[int]) -> None:
    """Save a box of the screen, with smooth edges and no button under the mouse."""
    blender.over_viewport()
    blender.ask("antialias", True)
    blender.settle()
    blender.screenshot(path, (box[0], box[1], box[2], box[3]))
    blender.ask("antialias", False)
    print(path, flush=True)


if __name__ == "__main__":
    main()
