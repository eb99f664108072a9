"""How near the first estimate of the time left is: `python -m benchmarks.first_estimate CHARACTER.glb …`.

For each animated character: seconds to learn from five of its frames and to apply the model, when the panel says the
first time how long it will take, what it says, and how long it takes from then on. Seconds are those of a clock, and of
all processors together if the machine is busy with other work (`--processor`).
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Callable
from pathlib import Path

import bpy

import wks_segment.blender
from benchmarks.speed import table_row
from wks_segment.blender.workflow.background_job import TIMER_INTERVAL, TimeLeft
from wks_segment.blender.workflow.segmentation_job import SegmentationJob
from wks_segment.core import MemoryCache
from wks_segment.core.progress import Progress

WITHIN = 1.5
"""Factor that the first estimate and the truth should not differ by."""
FEW = 5.0
"""Seconds below which the panel says "a few seconds left"."""


class Watch:
    """Looks at the progress of a job as the panel does, and keeps the first estimate."""

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock, self._began = clock, clock()
        self._left = TimeLeft()
        self._looked, self._share = 0.0, 0.0
        self.first: tuple[float, float] | None = None
        """Seconds after which there was an estimate, and the estimate."""

    def seconds(self) -> float:
        """Seconds since the beginning."""
        return self._clock() - self._began

    def __call__(self, stage: str, share: float) -> None:
        """Take a report of the job."""
        # The panel looks many times while the share stands.
        while self._looked + TIMER_INTERVAL < self.seconds():
            self._looked += TIMER_INTERVAL
            self._look(self._looked)
        self._share = share

    def _look(self, seconds: float) -> None:
        self._left.update(seconds, self._share)
        if self.first is None and self._left.seconds is not None:
            self.first = seconds, self._left.seconds


def main() -> None:
    """Print a line for each job."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("characters", nargs="+", type=Path, metavar="CHARACTER.glb")
    parser.add_argument("--processor", action="store_true", help="measure seconds of the processors, not of a clock")
    options = parser.parse_args()
    clock = time.process_time if options.processor else time.monotonic
    wks_segment.blender.register()
    header = ["character", "job", "seconds", "first estimate after, s", "left by it, s", "left, s", "ratio"]
    print(table_row(header))
    print(table_row(["---"] * len(header)), flush=True)
    for path in options.characters:
        for obj in list(bpy.data.objects):
            bpy.data.objects.remove(obj)
        bpy.ops.import_scene.gltf(filepath=str(path))
        meshes = [obj for obj in bpy.data.objects if obj.type == "MESH" and obj.visible_get()]
        for obj in bpy.context.view_layer.objects:
            obj.select_set(obj in meshes)
        bpy.context.view_layer.objects.active = meshes[0]
        bpy.context.scene.wks_segment.source = "FRAMES"
        job = SegmentationJob.learning(bpy.context, MemoryCache())
        print(line(path.stem, "learn", job, clock), flush=True)
        job.write()
        print(line(path.stem, "apply", SegmentationJob.applying(bpy.context, MemoryCache()), clock), flush=True)


def line(name: str, kind: str, job: SegmentationJob, clock: Callable[[], float]) -> str:
    """Run a job; the line of the table."""
    watch = Watch(clock)
    job.compute(Progress(watch))
    total = watch.seconds()
    if watch.first is None:
        return table_row([name, kind, f"{total:.1f}", *["–"] * 4])
    after, said = watch.first
    ratio = said / max(total - after, 0.1)
    right = 1 / WITHIN <= ratio <= WITHIN or max(said, total - after) < FEW
    shown = f"{ratio:.2f}" if right else f"**{ratio:.2f}**"
    return table_row([name, kind, f"{total:.1f}", f"{after:.1f}", f"{said:.1f}", f"{total - after:.1f}", shown])


if __name__ == "__main__":
    main()
    sys.stdout.flush()
    os._exit(0)  # bpy may hang at a normal exit
