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
SUBPANELS = {"outputs": "write_materials", "models": "wks_segment.save_model", "advanced": "snap_to"}
"""Sub-panel to one of its buttons."""
MARGIN_BELOW = 70
"""Pixels below the last button, which show the titles of closed sub-panels."""


def main() -> None:
    """Take all screenshots."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--blender", choices=SUITES, default="5.2")
    parser.add_argument("--output", type=Path, default=IMAGES)
    options = parser.parse_args()
    folder = Path(os.environ.get("WKS_SEGMENT_WINDOW", "window"))
    with tempfile.TemporaryDirectory() as temporary, RealBlender(options.blender, folder) as blender:
        blender.install_extension(build_zip(Path(temporary)))
        blender.start(blender.make_scene("creature", "creature.blend"), beautiful=True)
        blender.ask("zoom_to_all")
        take(blender, options.output)


def take(blender: RealBlender, folder: Path) -> None:
    """Go through the first steps of an artist, with a screenshot of each."""
    blender.select(BODY)
    blender.open_sidebar()
    blender.over_viewport()
    viewport(blender, folder / "window_before.png")
    blender.press("wks_segment.learn")
    blender.wait_for("segments", BODY)
    blender.over_viewport()
    viewport(blender, folder / "panel.png")
    for name, button in SUBPANELS.items():
        blender.find(button)  # opens its sub-panel
        panel(blender, folder / f"panel_{name}.png")


def viewport(blender: RealBlender, path: Path) -> None:
    """Save the 3D viewport with its side panel."""
    x, y, width, height = blender.ask("region", "WINDOW")
    blender.settle()
    blender.screenshot(path, (x, y, width, height))


def panel(blender: RealBlender, path: Path) -> None:
    """Save the side panel down to its last button."""
    x, y, width, height = blender.ask("region", "UI")
    last = max(place[1] for place in blender.ask("button", "none of these").values())
    blender.over_viewport()
    blender.screenshot(path, (x, y, width, min(height, last - y + MARGIN_BELOW)))


if __name__ == "__main__":
    main()
