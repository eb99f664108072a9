"""The whole job in Blender, by stage: `python -m benchmarks.job [--vertices 10000] [--poses 5] [--workers 1]`.

Makes a body in several poses as objects of a scene, learns its parts from them and writes labels, as the button does.
Prints one line of JSON: wall and CPU seconds of each stage.
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
from wks_segment.blender.workflow import pipeline
from wks_segment.blender.workflow.pipeline import LabelRequest, Run
from wks_segment.blender.workflow.report import Report
from wks_segment.core.poses import describe


def main() -> None:
    """Run once and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--vertices", type=int, default=10_000)
    parser.add_argument("--poses", type=int, default=5)
    parser.add_argument("--workers", type=int, help="poses solved side by side")
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
    """Wall and CPU seconds of each stage, from the objects to written labels."""
    settings = bpy.context.scene.wks_segment
    settings.source = "OBJECTS"
    report = Report([])
    stages: dict[str, dict[str, float]] = {}

    def timed(name: str, work: Callable[[], Any]) -> Any:
        wall, cpu = time.perf_counter(), time.process_time()
        result = work()
        stages[name] = {"wall": time.perf_counter() - wall, "cpu": time.process_time() - cpu}
        return result

    model = settings.new_model()
    poses = timed("read", lambda: read_training_poses(bpy.context, settings))
    described = timed("connect, eigenpairs, signature", lambda: pipeline.describe(model, poses, Run(report)))
    timed("mixture", lambda: model.fit(described))
    request = timed("read meshes", lambda: LabelRequest.of(settings, (pose.character for pose in poses)))
    labels = timed("label", lambda: pipeline.label(model, poses, described, request, Run(report)))
    timed("write", lambda: pipeline.write_outputs(settings, labels, request, report))
    return stages


if __name__ == "__main__":
    main()
