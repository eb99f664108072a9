"""Speed, accuracy and memory of eigensolvers, and duration of a job: `python -m benchmarks.speed [--output FILE.md]`.

Each solver runs in a new process on one BLAS thread, alternating with the others (A, B, C, A, B, C), on generated
meshes. The reference is `scipy.sparse.linalg.eigsh` in shift-invert mode, as other libraries call it; errors are
relative to our exact solver. LaPy is included if it is installed (`pip install .[peers]`). Then follow the stages of a
job in Blender, and the time of the least work that each method must do.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import os
import platform
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np
import scipy
from scipy.sparse import csr_matrix
from sklearn.metrics import adjusted_rand_score
from threadpoolctl import threadpool_limits

from benchmarks import growth, shapes
from benchmarks.solvers import METHODS, N_PAIRS
from wks_segment.core import TriangleMesh, fit_mixture, stiffness_matrix
from wks_segment.core.learning.standardizer import SIGNATURE_OFFSET
from wks_segment.core.mesh.triangle_mesh import FloatArray

SEGMENTS = 8
KINDS = ("even", "irregular", "border", "islands", "thin")
MAX_VERTICES = {"eigsh": 100_000, "lapy": 20_000, "exact": 1_000_000, "fast": 10_000_000}
"""Largest mesh of each solver; a larger one takes too long."""
EVERY_KIND_UP_TO = 20_000
"""Size up to which all kinds of meshes are measured; larger meshes are even or irregular, the largest are even."""
ROUNDS = 2
HEADER = [
    "mesh", "vertices", "solver", "CPU s", "× eigsh", "wall s", "memory MB", "eigenvalue error max, median",
    "WKS error", "same ARI",
]  # fmt: skip


def main() -> None:
    """Print all tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sizes", type=int, nargs="+", default=[5_000, 20_000, 100_000, 250_000, 1_000_000])
    parser.add_argument("--kinds", nargs="+", default=list(KINDS), choices=KINDS)
    parser.add_argument("--output", type=Path, help="also write the tables here, and a plot beside it in images/")
    options = parser.parse_args()
    lines: list[str] = []

    def say(line: str = "") -> None:
        print(line, flush=True)
        lines.append(line)

    say("# Speed\n\nMade by `python -m benchmarks.speed --output docs/speed.md` in one run: " + machine() + "\n")
    say(f"## Eigensolvers\n{N_PAIRS} pairs and the signature of 100 energies, from a mesh.\n")
    say(table_row(HEADER) + "\n" + table_row(["---"] * len(HEADER)))
    seconds: dict[str, dict[int, float]] = {}
    for size in options.sizes:
        for kind in kinds_of(size, options.kinds):
            for row, method, cpu in compare(kind, make(kind, size)):
                say(table_row(row))
                if kind == "even":
                    seconds.setdefault(method, {})[size] = cpu
    say(
        "\n## The whole job\nWall seconds from the objects of a scene to written labels, and the share of each stage.\n"
    )
    for line in jobs():
        say(line)
    say("\n## Least work\nWhat each method must compute at least, on the even mesh: seconds on one thread.\n")
    for line in least_work(options.sizes):
        say(line)
    if options.output:
        picture = options.output.parent / "images" / "speed.svg"
        picture.write_text(growth.plot(seconds), encoding="utf-8")
        say("\n## Growth\n![CPU seconds against vertices](images/speed.svg)")
        options.output.write_text("\n".join(lines) + "\n", encoding="utf-8")


def machine() -> str:
    """Date, processor and versions of a measurement."""
    model = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    if info.exists():
        model = next(
            (line.split(":")[1].strip() for line in info.read_text().splitlines() if "model name" in line), model
        )
    return (
        f"{date.today()}, {model}, {os.cpu_count()} cores, Python {platform.python_version()}, "
        f"NumPy {np.__version__}, SciPy {scipy.__version__}."
    )


def table_row(cells: Sequence[str]) -> str:
    """Line of a Markdown table."""
    return "| " + " | ".join(cells) + " |"


def kinds_of(size: int, kinds: Sequence[str]) -> list[str]:
    """Kinds of mesh that are measured at a size."""
    if size <= EVERY_KIND_UP_TO:
        return list(kinds)
    return [kind for kind in kinds if kind in (("even", "irregular") if size <= 100_000 else ("even",))]


def make(kind: str, size: int) -> TriangleMesh:
    """Mesh of a kind and approximate number of vertices."""
    mesh = shapes.body(round(size / shapes.KEPT_SHARE) if kind == "border" else size, irregular=kind == "irregular")
    changes: dict[str, Callable[[TriangleMesh], TriangleMesh]]
    changes = {"border": shapes.with_border, "islands": shapes.with_islands, "thin": shapes.thinned}
    return changes[kind](mesh) if kind in changes else mesh


def compare(kind: str, mesh: TriangleMesh) -> Iterator[tuple[list[str], str, float]]:
    """Run all solvers on a mesh; yield row of the table, name and CPU seconds of each."""
    methods = [m for m in METHODS if mesh.n_vertices <= 1.2 * MAX_VERTICES[m]]
    if kind != "even" or importlib.util.find_spec("lapy") is None:
        methods = [m for m in methods if m != "lapy"]
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder) / "mesh.npz"
        np.savez(source, vertices=mesh.vertices, faces=mesh.faces)
        runs: dict[str, list[dict[str, Any]]] = {method: [] for method in methods}
        for turn in range(ROUNDS):
            for method in methods:
                if turn == 0 or method != "exact" or mesh.n_vertices <= EVERY_KIND_UP_TO:
                    runs[method].append(run(method, source, Path(folder) / "result.npz"))
    truth = runs["exact"][0]
    labels_of = labeler(truth["signature"], mesh.vertex_areas)
    expected = labels_of(truth["signature"])
    for method in methods:
        best = min(runs[method], key=lambda r: r["cpu"])
        pairs = zip(runs.get("eigsh", []), runs[method], strict=False)
        times = [float(reference["cpu"] / result["cpu"]) for reference, result in pairs]
        above = truth["values"] > 1e-6 * truth["values"][-1]
        error = np.abs(best["values"][above] / truth["values"][above] - 1)
        wks = np.linalg.norm(best["signature"] - truth["signature"]) / np.linalg.norm(truth["signature"])
        row = [
            kind, f"{mesh.n_vertices:,}", method, f"{best['cpu']:.2f}", f"{np.median(times):.1f}" if times else "–",
            f"{best['wall']:.2f}", f"{best['memory']:,.0f}", f"{error.max():.1e}, {np.median(error):.1e}",
            f"{100 * wks:.2f} %", f"{adjusted_rand_score(expected, labels_of(best['signature'])):.4f}",
        ]  # fmt: skip
        yield row, method, float(best["cpu"])


def labeler(signature: FloatArray, areas: FloatArray) -> Callable[[FloatArray], Any]:
    """Function from signatures to labels, by one mixture that is fitted to the given signature."""
    step = max(1, len(signature) // 100_000)
    logs = np.log(signature[::step].astype(np.float64) + SIGNATURE_OFFSET)
    center, spread = logs.mean(axis=0), logs.std(axis=0)
    mixture = fit_mixture((logs - center) / spread, areas[::step], SEGMENTS)
    return lambda other: mixture.posteriors((np.log(other + SIGNATURE_OFFSET) - center) / spread).argmax(axis=1)


def run(method: str, source: Path, target: Path) -> dict[str, Any]:
    """One measurement in a new process on one thread."""
    command = [sys.executable, "-m", "benchmarks.solvers", method, str(source), str(target)]
    subprocess.run(command, check=True, env={**os.environ, **threads(1)})
    with np.load(target) as result:
        return {name: result[name] for name in result.files}


def threads(count: int) -> dict[str, str]:
    """Environment with a number of BLAS threads."""
    return {"OMP_NUM_THREADS": str(count), "OPENBLAS_NUM_THREADS": str(count)}


def jobs() -> Iterator[str]:
    """Table of the stages of a job, with one and with two poses at the same time."""
    header: list[str] = []
    for vertices, poses in ((10_000, 5), (100_000, 3)):
        for workers in (1, 2):
            command = [sys.executable, "-m", "benchmarks.job", "--vertices", str(vertices)]
            command += ["--poses", str(poses), "--workers", str(workers)]
            done = subprocess.run(command, check=True, capture_output=True, text=True)
            stages = json.loads(done.stdout.splitlines()[-1])
            if not header:
                header = ["vertices", "poses", "at a time", "all", *stages]
                yield table_row(header)
                yield table_row(["---"] * len(header))
            whole = sum(stage["wall"] for stage in stages.values())
            cells = [f"{stage['wall']:.2f} ({100 * stage['wall'] / whole:.0f} %)" for stage in stages.values()]
            yield table_row([f"{vertices:,}", str(poses), str(workers), f"{whole:.1f}", *cells])


def least_work(sizes: Sequence[int]) -> Iterator[str]:
    """Table of the time of the matrix, of one sparse product with all columns, and of one pass over the result."""
    yield table_row(["vertices", "stiffness matrix", "one product S X", "one pass over X"])
    yield table_row(["---"] * 4)
    for size in sizes:
        mesh = make("even", size)
        with threadpool_limits(1):
            assembly = clocked(stiffness_matrix, mesh)
            matrix = csr_matrix(stiffness_matrix(mesh)).astype(np.float32)
            columns = np.ones((size, 60), dtype=np.float32)
            share = N_PAIRS / columns.shape[1]
            product = share * min(clocked(matrix.__matmul__, columns) for _ in range(2))
            sweep = share * min(clocked(np.sum, columns) for _ in range(2))
        yield table_row([f"{size:,}", f"{assembly:.3f}", f"{product:.3f}", f"{sweep:.3f}"])


def clocked(function: Callable[[Any], Any], argument: Any) -> float:
    """CPU seconds of a call."""
    start = time.process_time()
    function(argument)
    return time.process_time() - start


if __name__ == "__main__":
    main()
