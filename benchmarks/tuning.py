"""Time until labels follow a change of settings: `python -m benchmarks.tuning [--vertices 10000] [--poses 5] [FILE]`.

Learns a body with shape keys, or five frames of a character in a file, and then changes settings as the sidebar does.
Prints a Markdown table: CPU seconds, and wall seconds of each stage. The first change of a kind computes intermediate
results that later ones reuse.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
import traceback
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import bpy

import wks_segment.blender
from benchmarks import shapes
from benchmarks.speed import table_row
from wks_segment.blender.scene import file_formats
from wks_segment.blender.workflow.live_session import session_of
from wks_segment.core import PoseSegmentation
from wks_segment.core.labeling.polygons import PolygonMesh
from wks_segment.core.progress import Progress

CHANGES: list[tuple[str, dict[str, Any]]] = [
    ("12 segments", {"n_segments": 12}),
    ("5 segments", {"n_segments": 5}),
    ("automatic", {"auto_segments": True}),
    ("8 segments", {"auto_segments": False, "n_segments": 8}),
    ("smoothness 1.5", {"smoothness": 1.5}),
    ("smoothness 0.7", {"smoothness": 0.7}),
    ("smallest part 2 %", {"min_share": 2.0}),
    ("snap to sharp edges", {"snap_to": {"sharp"}}),
    ("left and right, for the first time", {"sides": "two"}),
    ("one part for both", {"sides": "one"}),
    ("left and right again", {"sides": "two"}),
    ("… 6 segments", {"n_segments": 6}),
    ("… 14 segments", {"n_segments": 14}),
    ("… smoothness 1", {"smoothness": 1.0}),
    ("soft vertex groups", {"vertex_groups": "soft"}),
]
STAGE_COLUMNS = ("all, CPU", "all", "regroup", "read", "posteriors", "clean-up", "sides", "write")


class Clock:
    """Seconds of each stage; time in a stage within another one counts only for the outer one."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = defaultdict(float)
        self._inside = False

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Add the duration of a block to a stage."""
        if self._inside:
            yield
            return
        self._inside, start = True, time.perf_counter()
        yield
        self.seconds[name] += time.perf_counter() - start
        self._inside = False

    def wrap(self, owner: Any, name: str, stage: str) -> None:
        """Replace a function of a class by one whose duration counts as a stage."""
        function: Callable[..., Any] = getattr(owner, name)

        def timed(*arguments: Any, **options: Any) -> Any:
            with self.stage(stage):
                return function(*arguments, **options)

        setattr(owner, name, timed)


def main() -> None:
    """Learn once and measure all changes."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("file", type=Path, nargs="?")
    parser.add_argument("--vertices", type=int, default=10_000)
    parser.add_argument("--poses", type=int, default=5)
    options = parser.parse_args()
    bpy.ops.wm.read_homefile(use_empty=True)
    wks_segment.blender.register()
    code = 1
    try:
        if options.file:
            (objects,) = file_formats.open_files([options.file])
            for obj in objects:
                obj.select_set(obj.type == "MESH")
        else:
            keyed_body(options.vertices, options.poses)
        run(options.poses)
        code = 0
    except Exception:
        traceback.print_exc()
    finally:
        wks_segment.blender.unregister()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)  # some versions of bpy hang at exit


def keyed_body(n_vertices: int, n_poses: int) -> None:
    """Add an object with a pose in each shape key."""
    bodies = [shapes.body(n_vertices, bend=0.2 * i) for i in range(n_poses)]
    mesh = bpy.data.meshes.new("Body")
    mesh.from_pydata(bodies[0].vertices, [], bodies[0].faces)
    obj = bpy.data.objects.new("Body", mesh)
    bpy.context.collection.objects.link(obj)
    for i, body in enumerate(bodies):
        obj.shape_key_add(name=f"Pose {i + 1}").data.foreach_set("co", body.vertices.ravel())
    obj.select_set(True)
    bpy.context.view_layer.objects.active = obj
    bpy.context.scene.wks_segment.source = "SHAPE_KEYS"


def run(n_poses: int) -> None:
    """Learn, change settings and print the table."""
    scene, session = bpy.context.scene, session_of(bpy.context)
    settings = scene.wks_segment
    settings.live, settings.pose_count = False, n_poses
    start = time.perf_counter()
    bpy.ops.wks_segment.learn()
    took = time.perf_counter() - start
    assert session.job is not None
    print(f"\nLearned in {took:.1f} seconds: {', '.join(session.job.report.facts[:2])}.\n")
    clock = Clock()
    clock.wrap(PolygonMesh, "mean", "posteriors")
    clock.wrap(PolygonMesh, "labels", "clean-up")
    clock.wrap(PoseSegmentation, "polygon_sides", "sides")
    print(table_row(["change", *STAGE_COLUMNS]))
    print(table_row(["---"] * (1 + len(STAGE_COLUMNS))))
    for name, change in CHANGES:
        for setting, value in change.items():
            setattr(settings, setting, value)
        clock.seconds.clear()
        start, cpu = time.perf_counter(), time.process_time()
        update = session.updated(bpy.context)
        update.compute(Progress())
        session.write_all(update)
        whole = {"all, CPU": time.process_time() - cpu, "all": time.perf_counter() - start}
        seconds = {**update.jobs[0].report.seconds, **clock.seconds, **whole}
        print(table_row([name, *(f"{seconds.get(column, 0.0):.2f}" for column in STAGE_COLUMNS)]), flush=True)


if __name__ == "__main__":
    main()
