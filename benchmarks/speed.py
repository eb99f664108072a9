"""Eigensolvers on meshes of growing size: `python -m benchmarks.speed [--sizes 5000 20000] [--rounds 2]`.

Each method runs in a process of its own on one BLAS thread, in turn (A, B, C, A, B, C), on meshes that the command
makes: an even body, one of irregular triangles, one with a border, one with loose pieces. The reference is
`scipy.sparse.linalg.eigsh` in shift-invert mode, as other libraries call it. Prints a Markdown table.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from sklearn.metrics import adjusted_rand_score

from benchmarks import shapes
from wks_segment.core import (
    TriangleMesh,
    eigenpairs,
    fit_mixture,
    mass_matrix,
    stiffness_matrix,
    wave_kernel_signature,
)  # fmt: skip
from wks_segment.core.mesh import FloatArray
from wks_segment.core.segmentation import SIGNATURE_OFFSET

METHODS = ("eigsh", "fast", "exact")
N_PAIRS = 300
SEGMENTS = 8


def main() -> None:
    """Parse the command line and print the table, or do one measurement in a worker process."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sizes", type=int, nargs="+", default=[5_000, 20_000])
    parser.add_argument("--rounds", type=int, default=2)
    parser.add_argument("--kinds", nargs="+", default=["even", "irregular", "border", "pieces"])
    parser.add_argument("--methods", nargs="+", default=list(METHODS), choices=METHODS)
    parser.add_argument("--worker", nargs=3, metavar=("METHOD", "MESH", "RESULT"), help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.worker:
        work(*options.worker)
        return
    print("| mesh | vertices | method | CPU s | × eigsh | wall s | eigenvalue error max, median |"
          " WKS error | same ARI |\n|" + "---|" * 9)  # fmt: skip
    for size in options.sizes:
        for kind in options.kinds:
            compare(kind, make(kind, size), options.methods, options.rounds)


def make(kind: str, size: int) -> TriangleMesh:
    """The mesh of a kind."""
    mesh = shapes.body(size, irregular=kind == "irregular")
    if kind == "border":
        return shapes.with_border(mesh)
    return shapes.with_pieces(mesh) if kind == "pieces" else mesh


def compare(kind: str, mesh: TriangleMesh, methods: list[str], rounds: int) -> None:
    """Run all methods in turn and print their rows."""
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder) / "mesh.npz"
        np.savez(source, vertices=mesh.vertices, faces=mesh.faces)
        runs: dict[str, list[dict[str, Any]]] = {method: [] for method in methods}
        for _ in range(rounds):
            for method in methods:
                runs[method].append(run(method, source, Path(folder) / f"{method}.npz"))
        reference = runs[methods[0]][0]
        labels_of = labeller(reference["signature"], mesh.vertex_areas)
        expected = labels_of(reference["signature"])
        for method in methods:
            best = min(runs[method], key=lambda r: r["cpu"])
            times = np.median([b["cpu"] / r["cpu"] for b, r in zip(runs[methods[0]], runs[method], strict=True)])
            above = reference["values"] > 1e-6 * reference["values"][-1]
            error = np.abs(best["values"][above] / reference["values"][above] - 1)
            wks = np.linalg.norm(best["signature"] - reference["signature"]) / np.linalg.norm(reference["signature"])
            print(
                f"| {kind} | {mesh.n_vertices:,} | {method} | {best['cpu']:.2f} | {times:.1f} | {best['wall']:.2f} "
                f"| {error.max():.1e}, {np.median(error):.1e} | {100 * wks:.2f} % "
                f"| {adjusted_rand_score(expected, labels_of(best['signature'])):.4f} |",
                flush=True,
            )


def labeller(signature: FloatArray, areas: FloatArray) -> Any:
    """A function from signatures to labels, by one mixture that is fitted on the reference."""
    logs = np.log(signature + SIGNATURE_OFFSET)
    centre, spread = logs.mean(axis=0), logs.std(axis=0)
    mixture = fit_mixture((logs - centre) / spread, areas, SEGMENTS)
    return lambda other: mixture.posteriors((np.log(other + SIGNATURE_OFFSET) - centre) / spread).argmax(axis=1)


def run(method: str, source: Path, target: Path) -> dict[str, Any]:
    """One measurement in a fresh process on one thread."""
    threads = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    command = [sys.executable, "-m", "benchmarks.speed", "--worker", method, str(source), str(target)]
    subprocess.run(command, check=True, env={**os.environ, **threads})
    with np.load(target) as result:
        return {name: result[name] for name in result.files}


def work(method: str, source: str, target: str) -> None:
    """Solve once and save eigenvalues, signature, seconds and memory."""
    with np.load(source) as arrays:
        mesh = TriangleMesh(arrays["vertices"], arrays["faces"])
    cpu, wall = time.process_time(), time.perf_counter()
    if method == "eigsh":
        values, functions = by_eigsh(mesh)
    else:
        values, functions = eigenpairs(mesh, N_PAIRS, "fast" if method == "fast" else "exact")
    cpu, wall = time.process_time() - cpu, time.perf_counter() - wall
    signature = wave_kernel_signature(values, functions)
    np.savez(target, values=values, signature=signature, cpu=cpu, wall=wall)


def by_eigsh(mesh: TriangleMesh) -> tuple[FloatArray, FloatArray]:
    """SciPy's shift-invert Lanczos, as pyFM and the examples of robust_laplacian call it, on the area-1 surface."""
    from scipy.sparse.linalg import eigsh

    values, functions = eigsh(stiffness_matrix(mesh), N_PAIRS, M=mass_matrix(mesh) / mesh.area, sigma=-0.01)
    return np.maximum(values, 0), functions


if __name__ == "__main__":
    main()
