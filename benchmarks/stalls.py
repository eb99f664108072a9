"""How long Blender's window would stand still while a job runs: `python -m benchmarks.stalls [--vertices 20000]`.

Learns in a thread, as the button does, while this thread does what Blender's does: it sleeps for a moment, and wants to
go on. Prints one line of JSON: seconds of reading and writing, which are done in one go, the longest gaps in between
with the stage and the call that the job was at, and the longest time from asking for the end to the end.
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

MOMENT = 0.02
"""Seconds between two looks."""
SHOWN = 5


def main() -> None:
    """Run once and print."""
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
    """Learn, and measure."""
    begun = time.perf_counter()
    work = SegmentationJob.learning(bpy.context, MemoryCache())
    read = time.perf_counter() - begun
    gaps, job = watched(work)
    job.result()
    begun = time.perf_counter()
    work.write()
    written = time.perf_counter() - begun
    return {"read": read, "write": written, "stages": work.report.seconds, "longest": gaps}


def watched(work: SegmentationJob) -> tuple[list[dict[str, Any]], BackgroundJob]:
    """The longest gaps between two looks while the work is computed, and the job."""
    gaps: list[dict[str, Any]] = []
    job = BackgroundJob("Learn and Segment", work.compute, work.guard.glance)
    last, over = time.perf_counter(), False
    ticks: list[tuple[float, str, float]] = []
    while not over:
        over = job.step()
        time.sleep(MOMENT)
        now = time.perf_counter()
        stage = job.stage
        gaps.append({"seconds": now - last - MOMENT, "stage": stage, "share": job.share, "at": _places()})
        last = now
        if not ticks or ticks[-1][1] != stage:
            ticks.append((now, stage, job.share))
    print(*(f"{at - ticks[0][0]:7.2f} {share:.3f} {stage}" for at, stage, share in ticks), sep="\n", file=sys.stderr)
    return sorted(gaps, key=lambda gap: -gap["seconds"])[:SHOWN], job


def _places() -> list[str]:
    """What other threads are at: the innermost calls of our own."""
    frames = {ident: frame for ident, frame in sys._current_frames().items() if ident != threading.get_ident()}
    found = []
    for frame in frames.values():
        calls = [call for call in traceback.extract_stack(frame) if "wks_segment" in call.filename]
        if calls:
            found.append(f"{os.path.basename(calls[-1].filename)}:{calls[-1].lineno} {calls[-1].line}")
    return found


if __name__ == "__main__":
    main()
