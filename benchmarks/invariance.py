"""The same character, written otherwise: `python -m benchmarks.invariance FOLDER…`.

Each rigged character is learned twice: as it is, and turned, moved and scaled, with its vertices, faces, corners and
poses in another order. Prints the share of the area with the same label both times, 1 if learning depends on the shape
alone. Exits with 1 below `FLOOR`.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from benchmarks.rigs import CACHE, Rig, files, load
from benchmarks.speed import table_row
from wks_segment.core import PoseSegmentation, TriangleMesh, connect
from wks_segment.core.mesh.triangle_mesh import FloatArray, IntArray

FLOOR = 0.995
"""Least mean share of the area with the same label."""
SCALE, SHIFT = 3.7, (5.0, -2.0, 1.0)


def main() -> int:
    """Print the shares of all characters in some folders; return 1 if their mean is below the floor."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", type=Path, nargs="+", metavar="FOLDER")
    parser.add_argument("--cache", type=Path, default=CACHE, help="folder of the characters as arrays")
    options = parser.parse_args()
    print(table_row(["character", "same label"]) + "\n|---|---|")
    shares = []
    for path in files(options.folders):
        rig = load(path, options.cache)
        shares.append(share_of_same_labels(rig, seed=0))
        print(table_row([rig.name, f"{shares[-1]:.3f}"]), flush=True)
    print(table_row([f"**mean of {len(shares)}**", f"{np.mean(shares):.3f}"]))
    return int(np.mean(shares) < FLOOR)


def share_of_same_labels(rig: Rig, seed: int) -> float:
    """Share of the area of a character that has the same label when the character is written otherwise."""
    random = np.random.default_rng(seed)
    turn = np.linalg.qr(random.normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    vertex, face = random.permutation(len(rig.rest)), random.permutation(len(rig.faces))
    corners = (np.arange(3) + random.integers(0, 3, (len(face), 1))) % 3
    faces = np.take_along_axis(np.argsort(vertex)[rig.faces[face]], corners, axis=1)

    def otherwise(points: FloatArray) -> TriangleMesh:
        return TriangleMesh((SCALE * points @ turn + SHIFT)[vertex], faces)

    learned = rig.learned
    expected = labels_of(learned, rig.rest_mesh)
    poses = [otherwise(learned[i].vertices) for i in random.permutation(len(learned))]
    found = labels_of(poses, otherwise(rig.rest))
    return float(np.average(found == expected[face], weights=rig.rest_mesh.face_areas[face]))


def labels_of(poses: Sequence[TriangleMesh], rest: TriangleMesh) -> IntArray:
    """(m,) labels of a mesh that a model of its poses gives to all of them together."""
    model = PoseSegmentation()
    described = model.describe_all(poses, [connect(*poses, rest=rest)] * len(poses), workers=1)
    return model.fit(described, rest=rest).segment_polygons(described, [np.arange(rest.n_faces)] * len(poses))


if __name__ == "__main__":
    raise SystemExit(main())
