"""Time for which Blender's window is blocked by a job: `python -m benchmarks.stalls [--vertices 20000]`.

Learns in a thread, as Learn and Segment does, while the main thread sleeps for short times, as Blender's does. Prints
JSON: seconds of reading and writing, which block the window, seconds of each stage, and the longest delays of the main
thread with the stage and the call that caused them.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import threading
import time
import traceback
from typing import Any

import bpy

import wks_segment.blender
from benchmarks import shapes
from wks_segment.blender.workflow.background_job import BackgroundJob
from wks_segment.blender.workflow.segmentation_job import SegmentationJob
from wks_segment.core import MemoryCache

SLEEP_SECONDS = 0.02
"""Seconds that the main thread sleeps at a time."""
N_GAPS = 5
"""Number of the longest delays that are printed."""


def main() -> None:
    """Run the job once and print the result."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--vertices", type=int, default=20_000)
    parser.add_argument("--poses", type=int, default=5)
    parser.add_argument("--sides", choices=("one", "two"), default="one")
    parser.add_argument("--vertex-groups", choices=("none", "hard", "soft"), default="none")
    options = parser.parse_args()
    bpy.ops.wm.read_homefile(use_empty=True)
    wks_segment.blender.register()
    try:
        settings = bpy.context.scene.wks_segment
        settings.source, settings.sides, settings.vertex_groups = "OBJECTS", options.sides, options.vertex_groups
        for i in range(options.poses):
            body = shapes.body(options.vertices, bend=0.2 * i)
            mesh = bpy.data.meshes.new(f"Pose {i + 1}")
            mesh.from_pydata(body.vertices, [], body.faces)
            obj = bpy.data.objects.new(mesh.name, mesh)
            bpy.context.collection.objects.link(obj)
            obj.select_set(True)
        bpy.context.view_layer.objects.active = obj
        print(json.dumps(run(), indent=1))
        code = 0
    except Exception:
        traceback.print_exc()
        code = 1
    finally:
        wks_segment.blender.unregister()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)  # some versions of bpy hang at exit


def run() -> dict[str, Any]:
    """Learn, and measure each phase."""
    begun = time.perf_counter()
    job = SegmentationJob.learning(bpy.context, MemoryCache())
    read = time.perf_counter() - begun
    gaps, background_job = watched(job)
    background_job.result()
    begun = time.perf_counter()
    job.write()
    written = time.perf_counter() - begun
    return {"read": read, "write": written, "stages": job.report.seconds, "longest": gaps}


def watched(job: SegmentationJob) -> tuple[list[dict[str, Any]], BackgroundJob]:
    """The longest delays of this thread while a job runs, and the job."""
    gaps: list[dict[str, Any]] = []
    running = BackgroundJob("Learn and Segment", job.compute, job.guard.check_quickly)
    last, over = time.perf_counter(), False
    ticks: list[tuple[float, str, float]] = []
    while not over:
        over = running.step()
        time.sleep(SLEEP_SECONDS)
        now = time.perf_counter()
        stage = running.stage
        gaps.append({"seconds": now - last - SLEEP_SECONDS, "stage": stage, "share": running.share, "at": _places()})
        last = now
        if not ticks or ticks[-1][1] != stage:
            ticks.append((now, stage, running.share))
    print(*(f"{at - ticks[0][0]:7.2f} {share:.3f} {stage}" for at, stage, share in ticks), sep="\n", file=sys.stderr)
    return sorted(gaps, key=lambda gap: -gap["seconds"])[:N_GAPS], running


def _places() -> list[str]:
    """Innermost call of this package in each other thread."""
    frames = {ident: frame for ident, frame in sys._current_frames().items() if ident != threading.get_ident()}
    places = []
    for frame in frames.values():
        calls = [call for call in traceback.extract_stack(frame) if "wks_segment" in call.filename]
        if calls:
            places.append(f"{os.path.basename(calls[-1].filename)}:{calls[-1].lineno} {calls[-1].line}")
    return places


if __name__ == "__main__":
    main()
