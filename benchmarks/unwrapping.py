"""Figures of Unwrap Segments: `python -m benchmarks.unwrapping FILE.blend…`, with files that `segment` has written.

Prints a Markdown table with a row for each object:

worst segment  median density of the segment where it is lowest, relative to the median of all faces
even           share of the faces whose density is within 4 times of the median
overlap        share of the covered pixels of 1024 × 1024 that are covered twice
stretch        how much longer a small circle becomes in one direction than across
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from pathlib import Path

import bpy
import numpy as np

import wks_segment.blender
from benchmarks.speed import table_row
from wks_segment.blender.outputs.part_attributes import labels_on
from wks_segment.blender.outputs.unwrapping import ALONG_SEAMS, unwrap_parts
from wks_segment.blender.scene.topology import polygon_mesh
from wks_segment.core.mesh.triangle_mesh import IntArray
from wks_segment.core.uv.quality import UvQuality, covered_pixels, densities, overlaps

SIZE = 1024


def measure(obj: bpy.types.Object, labels: IntArray) -> list[str]:
    """Cells of the row of an object with the (p,) segments of its polygons."""
    start = time.perf_counter()
    uvs = unwrap_parts(bpy.context, obj, labels, ALONG_SEAMS)
    seconds = time.perf_counter() - start
    mesh = polygon_mesh(obj.data)
    density, quality, triangles = densities(mesh, uvs), UvQuality.of(mesh, uvs), uvs[mesh.triangles]
    worst = min(np.median(density[labels == part]) for part in np.unique(labels))
    pixels = np.unique(covered_pixels(triangles, SIZE)[0])
    twice = len(overlaps(triangles, np.zeros(len(triangles), dtype=np.int64), SIZE)) / len(pixels)
    figures = [f"{worst:.2f}", f"{quality.even:.1%}", f"{twice:.2%}", f"{quality.stretch:.2f}", f"{seconds:.1f}"]
    return [f"{len(labels):,}", *figures]


def main() -> None:
    """Measure all objects with segments in some files."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", type=Path, nargs="+", metavar="FILE")
    header = ["object", "faces", "worst segment", "even", "overlap", "stretch", "seconds"]
    paths = parser.parse_args().files
    wks_segment.blender.register()
    print(table_row(header) + f"\n|{'---|' * len(header)}")
    for path in paths:
        bpy.ops.wm.open_mainfile(filepath=str(path))
        for obj in bpy.data.objects:
            labels = labels_on(obj.data) if obj.type == "MESH" else None
            if labels is not None:
                bpy.context.view_layer.objects.active = obj
                print(table_row([f"{path.stem} {obj.name}", *measure(obj, labels)]), flush=True)


if __name__ == "__main__":
    main()
    sys.stdout.flush()
    os._exit(0)  # some versions of bpy crash at a normal exit
