"""Labels of damaged meshes against those of clean ones: `python -m benchmarks.robustness MAKEHUMAN_FOLDER`.

A model is learned on four clean poses of a body and applied to poses that it never saw, clean and damaged. Prints a
Markdown table of the share of the damaged mesh's area that has the label which the clean one has there.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from benchmarks import makehuman
from benchmarks.perturbations import PERTURBATIONS, Perturbation
from benchmarks.speed import table_row
from wks_segment.core import PoseSegmentation, TriangleMesh
from wks_segment.core.mesh.triangle_mesh import IntArray

LEARNED, TESTED = (1, 2, 3, 4), (5, 6)
"""Seeds of the poses."""


def main() -> None:
    """Learn, damage, label, print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--segments", type=int, default=8)
    parser.add_argument("--eigenpairs", type=int, default=300)
    parser.add_argument("--laplacian", default="auto", choices=("auto", "cotangent", "delaunay"))
    parser.add_argument("--kinds", nargs="+", default=list(PERTURBATIONS), choices=PERTURBATIONS)
    options = parser.parse_args()
    model = PoseSegmentation(options.segments, n_eigenpairs=options.eigenpairs, laplacian=options.laplacian)
    table(options.folder, model, options.kinds)


def table(folder: Path, model: PoseSegmentation, kinds: Sequence[str] = tuple(PERTURBATIONS)) -> None:
    """Learn a model on clean poses of the body and print how much of damaged ones keeps its label."""
    body = makehuman.load(folder)
    model.fit([body.posed(seed) for seed in LEARNED])
    clean = [body.posed(seed) for seed in TESTED]
    expected = [model.segment_faces(mesh) for mesh in clean]
    print(table_row(["damage", "weak", "middle", "strongest"]) + "\n" + table_row(["---"] * 4))
    for kind in kinds:
        shares = agreements(model, PERTURBATIONS[kind], clean, expected)
        print(table_row([kind, *(f"{share:.3f}" for share in shares)]), flush=True)


def agreements(
    model: PoseSegmentation, perturbation: Perturbation, clean: Sequence[TriangleMesh], expected: Sequence[IntArray]
) -> list[float]:
    """Share of the area that keeps its label at each strength, the mean of all meshes."""
    damage, strengths = perturbation
    shares = []
    for strength in strengths:
        of_meshes = []
        for i, mesh in enumerate(clean):
            damaged, owner = damage(mesh, strength, np.random.default_rng(i))
            known = owner >= 0
            same = model.segment_faces(damaged)[known] == expected[i][owner[known]]
            # The area that a face stands for is that of the clean mesh: noise and spikes make more of it.
            pieces = np.bincount(owner[known], minlength=mesh.n_faces)
            of_meshes.append(np.average(same, weights=(mesh.face_areas / np.maximum(pieces, 1))[owner[known]]))
        shares.append(float(np.mean(of_meshes)))
    return shares


if __name__ == "__main__":
    main()
    sys.stdout.flush()
    os._exit(0)  # some versions of bpy crash at a normal exit
