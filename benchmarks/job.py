"""Duration of each stage of a job: `python -m benchmarks.job [--vertices 10000] [--poses 5] [--workers 1]`.

Makes objects of one body in several poses, learns parts from them and writes labels, as Learn and Segment does in a
window, which shows first colors. Prints one line of JSON: wall and CPU seconds of each stage.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
import traceback
from collections.abc import Callable
from typing import Any

import bpy

import wks_segment.blender
from benchmarks import shapes
from wks_segment.blender.scene.pose_sources import read_training_poses
from wks_segment.blender.workflow import describing, pipeline
from wks_segment.blender.workflow.describing import Run
from wks_segment.blender.workflow.pipeline import LabelRequest
from wks_segment.blender.workflow.report import Report
from wks_segment.core.draft.segments import draft
from wks_segment.core.poses import describe


def main() -> None:
    """Run the job once and print the result."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--vertices", type=int, default=10_000)
    parser.add_argument("--poses", type=int, default=5)
    parser.add_argument("--workers", type=int, help="poses that are computed at the same time")
    options = parser.parse_args()
    if options.workers:
        describe.MAX_WORKERS = options.workers
    bpy.ops.wm.read_homefile(use_empty=True)
    wks_segment.blender.register()
    try:
        for i in range(options.poses):
            body = shapes.body(options.vertices, bend=0.2 * i)
            mesh = bpy.data.meshes.new(f"Pose {i + 1}")
            mesh.from_pydata(body.vertices, [], body.faces)
            obj = bpy.data.objects.new(mesh.name, mesh)
            bpy.context.collection.objects.link(obj)
            obj.select_set(True)
        bpy.context.view_layer.objects.active = obj
        print(json.dumps(run()))
        code = 0
    except Exception:
        traceback.print_exc()
        code = 1
    finally:
        wks_segment.blender.unregister()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)  # some versions of bpy hang at exit


def run() -> dict[str, dict[str, float]]:
    """Wall and CPU seconds of each stage, from reading the objects to writing the labels."""
    settings = bpy.context.scene.wks_segment
    settings.source = "OBJECTS"
    job = Run(Report([]))
    stages: dict[str, dict[str, float]] = {}

    def timed(name: str, function: Callable[..., Any], *arguments: Any) -> Any:
        wall, cpu = time.perf_counter(), time.process_time()
        result = function(*arguments)
        stages[name] = {"wall": time.perf_counter() - wall, "cpu": time.process_time() - cpu}
        return result

    model = settings.new_model()
    poses = timed("read", read_training_poses, bpy.context, settings, Report([]))
    prepared = timed("connect", describing.prepare, model, poses, job)
    connections = [prepared.connections[i] for i in prepared.originals]
    timed("first colors", draft, model, [pose.mesh for pose in poses], connections)
    described = timed("eigenpairs, signature", describing.describe, model, poses, job, prepared)
    timed("mixture", model.fit, described)
    request = timed("read meshes", LabelRequest.of, settings, [pose.character for pose in poses])
    labels = timed("label", pipeline.label, model, poses, described, request, job)
    timed("write", pipeline.write_outputs, settings, labels, request, job.report)
    return stages


if __name__ == "__main__":
    main()
