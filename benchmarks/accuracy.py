"""Accuracy of the fast eigensolver on given meshes, compared with the exact one: `python -m benchmarks.accuracy PATH…`.

PATH is an .npz file with `vertices` and `faces`, or a folder of such files. Each mesh is welded and refined as in the
extension. Prints a Markdown table with the worst mesh last, and a summary: error of the signature, agreement of labels
(adjusted Rand index, with one mixture that is fitted to the exact signature), and CPU seconds on one BLAS thread.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from sklearn.metrics import adjusted_rand_score
from threadpoolctl import threadpool_limits

from benchmarks.solvers import N_PAIRS
from benchmarks.speed import labeler, table_row
from wks_segment.core import TriangleMesh, eigenpairs, prepare_surface, wave_kernel_signature
from wks_segment.core.poses.describe import VERTICES_PER_PAIR
from wks_segment.core.spectral.signature import wave_kernel_signature_of

LARGE_ERROR = 0.7
"""Error of the signature, in percent, above which a mesh is counted in the summary."""


def main() -> None:
    """Compare the solvers on all meshes."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("paths", type=Path, nargs="+", metavar="PATH")
    options = parser.parse_args()
    files = mesh_files(options.paths)
    if not files:
        parser.error("there is no .npz file")
    rows = []
    for path in files:
        with np.load(path) as arrays:
            mesh = TriangleMesh(arrays["vertices"], arrays["faces"])
        rows.append((path.stem, *compare(mesh)))
        print(f"{len(rows)} of {len(files)}: {path.stem}, {rows[-1][2]:.2f} %", flush=True)
    print(table_row(["mesh", "vertices", "WKS error", "same ARI", "fast CPU s", "exact CPU s"]))
    print(table_row(["---"] * 6))
    for name, size, error, index, fast, exact in sorted(rows, key=lambda row: row[2]):
        print(table_row([name, f"{size:,}", f"{error:.2f} %", f"{index:.4f}", f"{fast:.2f}", f"{exact:.2f}"]))
    errors, indices = np.array([row[2] for row in rows]), np.array([row[3] for row in rows])
    print(
        f"\n{len(rows)} meshes: WKS error {errors.mean():.2f} % on average, {errors.max():.2f} % at most, "
        f"{np.count_nonzero(errors > LARGE_ERROR)} over {LARGE_ERROR} %; index {indices.mean():.4f} on average, "
        f"{indices.min():.4f} at least"
    )


def mesh_files(paths: Sequence[Path]) -> list[Path]:
    """The given files, and all .npz files in the given folders."""
    return [file for path in paths for file in (sorted(path.glob("*.npz")) if path.is_dir() else [path])]


@threadpool_limits.wrap(limits=1)
def compare(mesh: TriangleMesh) -> tuple[int, float, float, float, float]:
    """Number of vertices, error in percent, adjusted Rand index, CPU seconds of the fast and of the exact solver."""
    mesh = prepare_surface(mesh, VERTICES_PER_PAIR * N_PAIRS).mesh
    n_pairs = N_PAIRS + int(mesh.islands.max())
    start = time.process_time()
    truth = wave_kernel_signature(*eigenpairs(mesh, n_pairs, "exact"))
    between = time.process_time()
    signature = wave_kernel_signature_of(mesh, n_pairs)
    end = time.process_time()
    labels_of = labeler(truth, mesh.vertex_areas)
    return (
        mesh.n_vertices,
        float(100 * np.linalg.norm(signature - truth) / np.linalg.norm(truth)),
        float(adjusted_rand_score(labels_of(truth), labels_of(signature))),
        end - between,
        between - start,
    )


if __name__ == "__main__":
    main()
