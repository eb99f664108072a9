"""Labels of damaged meshes compared with those of clean ones: `python -m benchmarks.robustness MAKEHUMAN_FOLDER`.

A model is learned from four clean poses of a body and applied to unseen poses, clean and damaged. Prints a Markdown
table of the share of the area on which the damaged mesh has the same label as the clean one.
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

LEARNED_SEEDS, TESTED_SEEDS = (1, 2, 3, 4), (5, 6)
"""Seeds of the random poses that are learned and of those that are labeled."""


def main() -> None:
    """Measure the damages that the options ask for."""
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
    """Fit a model to clean poses of the body; print the agreement of labels for each kind of damage."""
    body = makehuman.load(folder)
    model.fit([body.posed(seed) for seed in LEARNED_SEEDS])
    clean = [body.posed(seed) for seed in TESTED_SEEDS]
    expected = [model.segment_faces(mesh) for mesh in clean]
    print(table_row(["damage", "weak", "medium", "strong"]) + "\n" + table_row(["---"] * 4))
    for kind in kinds:
        shares = agreements(model, PERTURBATIONS[kind], clean, expected)
        print(table_row([kind, *(f"{share:.3f}" for share in shares)]), flush=True)


def agreements(
    model: PoseSegmentation, perturbation: Perturbation, clean: Sequence[TriangleMesh], expected: Sequence[IntArray]
) -> list[float]:
    """Share of the area that keeps its label, for each strength, averaged over all meshes."""
    damage, strengths = perturbation
    shares = []
    for strength in strengths:
        of_meshes = []
        for i, mesh in enumerate(clean):
            damaged, owner = damage(mesh, strength, np.random.default_rng(i))
            known = owner >= 0
            same = model.segment_faces(damaged)[known] == expected[i][owner[known]]
            # Areas are those of the clean mesh, since noise and spikes enlarge those of the damaged one.
            counts = np.bincount(owner[known], minlength=mesh.n_faces)
            of_meshes.append(np.average(same, weights=(mesh.face_areas / np.maximum(counts, 1))[owner[known]]))
        shares.append(float(np.mean(of_meshes)))
    return shares


if __name__ == "__main__":
    main()
    sys.stdout.flush()
    os._exit(0)  # some versions of bpy crash at a normal exit
