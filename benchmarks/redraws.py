"""Time between redraws of Blender's window while it learns: `python -m benchmarks.redraws [--blender 5.2]`.

Opens a real Blender, clicks Learn and Segment with the mouse, and redraws the viewport all the time. Blender is taken
from the folder that WKS_SEGMENT_WINDOW names, or installed there; `tests/window` says what that needs. Prints a table:
seconds until the segments are written, number of redraws in that time, and the time between two of them.
"""

from __future__ import annotations

import argparse
import os
import tempfile
from pathlib import Path

import numpy as np

from benchmarks import shapes
from tests.window.driver import SUITES, RealBlender, build_zip

HEADER = "| Blender | poses × vertices | learned in | redraws | median gap | 99th percentile | longest gap |"


def main() -> None:
    """Measure all versions of Blender."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--blender", nargs="+", choices=SUITES, default=list(SUITES))
    parser.add_argument("--vertices", type=int, default=20_000)
    parser.add_argument("--poses", type=int, default=5)
    options = parser.parse_args()
    folder = Path(os.environ.get("WKS_SEGMENT_WINDOW", "window"))
    print(HEADER, "|---" * HEADER.count(" |") + "|", sep="\n", flush=True)
    with tempfile.TemporaryDirectory() as temporary:
        extension = build_zip(Path(temporary))
        bodies = Path(temporary, "bodies.npz")
        save_bodies(bodies, options.poses, options.vertices)
        for version in options.blender:
            with RealBlender(version, folder) as blender:
                blender.install_extension(extension)
                gaps = gaps_while_learning(blender, bodies)
            median, most = np.percentile(gaps, [50, 99])
            print(
                f"| {version} | {options.poses} × {options.vertices:,} | {sum(gaps):.1f} s | {len(gaps)} | "
                f"{median:.2f} s | {most:.2f} s | {max(gaps):.2f} s |",
                flush=True,
            )


def save_bodies(path: Path, n_poses: int, n_vertices: int) -> None:
    """Write a body in several poses to a file for `make_scene.py`."""
    bodies = [shapes.body(n_vertices, bend=0.2 * i) for i in range(n_poses)]
    arrays = {f"vertices_{i}": body.vertices for i, body in enumerate(bodies)}
    np.savez(path, **arrays, **{f"faces_{i}": body.faces for i, body in enumerate(bodies)})


def gaps_while_learning(blender: RealBlender, bodies: Path) -> list[float]:
    """Seconds between redraws, from the click until the segments are written."""
    blender.start(blender.make_scene(blender.bring(bodies), "bodies.blend"))
    blender.ask("zoom_to_all")
    blender.open_sidebar()
    button = blender.find("wks_segment.learn")
    blender.ask("watch_redraws")
    blender.click(*button)
    blender.wait_for("segments", "Pose 1")
    blender.settle()
    gaps: list[float] = blender.ask("redraws")
    return gaps


if __name__ == "__main__":
    main()
