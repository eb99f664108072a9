"""Another number of segments without a new fit, compared with a new fit: `python -m benchmarks.regroup FILE…`.

Five frames of the animation in each file are learned with eight segments. Prints a Markdown table of the share of the
area with the same label as in a new fit with another number of segments, after the best matching of segments.
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

import bpy
import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.sparse import coo_matrix

import wks_segment.blender
from benchmarks.speed import table_row
from wks_segment.blender.scene import file_formats
from wks_segment.blender.scene.pose_sources import read_training_poses
from wks_segment.blender.workflow import describing
from wks_segment.blender.workflow.describing import Run
from wks_segment.blender.workflow.report import Report
from wks_segment.core import PoseSegmentation
from wks_segment.core.mesh.triangle_mesh import FloatArray, IntArray

NUMBERS = (4, 6, 10, 12, 16)
"""Numbers of segments to compare."""


def main() -> None:
    """Compare on all files."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("files", type=Path, nargs="+")
    options = parser.parse_args()
    wks_segment.blender.register()
    code = 1
    try:
        print(table_row(["character", *(f"8 → {number}" for number in NUMBERS)]))
        print(table_row(["---"] * (1 + len(NUMBERS))))
        for path in options.files:
            print(table_row([path.stem, *(f"{share:.3f}" for share in agreements(path))]), flush=True)
        code = 0
    finally:
        wks_segment.blender.unregister()
        sys.stdout.flush()
        sys.stderr.flush()
        if code == 0:
            os._exit(0)  # some versions of bpy hang at exit


def agreements(path: Path) -> list[float]:
    """Agreement of the regrouped model with a new one, for each number of segments."""
    (objects,) = file_formats.open_files([path])
    for obj in objects:
        obj.select_set(obj.type == "MESH")
    settings = bpy.context.scene.wks_segment
    poses = read_training_poses(bpy.context, settings, Report([]))
    polygons, rest = [pose.polygon_of for pose in poses], poses[0].upright
    eight = settings.new_model()
    described = describing.describe(eight, poses, Run(Report([])))
    eight.fit(described, rest=rest)
    areas = np.bincount(polygons[0], poses[0].mesh.face_areas).astype(np.float64)
    shares = []
    for number in NUMBERS:
        fresh = PoseSegmentation(number).fit(described, rest=rest)
        regrouped = eight.with_segments(number).segment_polygons(described, polygons)
        refitted = fresh.segment_polygons(described, polygons)
        shares.append(matched_share(regrouped, refitted, areas))
    return shares


def matched_share(labels: IntArray, others: IntArray, areas: FloatArray) -> float:
    """Share of the area with the same label, after the best matching of labels."""
    shared = coo_matrix((areas, (labels, others))).toarray()
    return float(shared[linear_sum_assignment(-shared)].sum() / areas.sum())


if __name__ == "__main__":
    main()
