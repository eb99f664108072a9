"""Time and memory of one eigensolver on one mesh: `python -m benchmarks.solvers METHOD MESH.npz RESULT.npz`.

Each method computes the Wave Kernel Signature of a mesh: 300 eigenpairs, 100 energies, surface scaled to area 1.
`benchmarks.speed` starts this command in a new process for each run.
"""

from __future__ import annotations

import re
import sys
import time
from pathlib import Path

import numpy as np

from wks_segment.core import TriangleMesh, eigenpairs, mass_matrix, stiffness_matrix, wave_kernel_signature
from wks_segment.core.mesh.triangle_mesh import FloatArray
from wks_segment.core.spectral.eigenpairs import eigenpair_panels
from wks_segment.core.spectral.signature import wave_kernel_signature_of

N_PAIRS = 300
METHODS = ("eigsh", "lapy", "fast", "exact")


def solve(method: str, mesh: TriangleMesh) -> tuple[FloatArray, FloatArray]:
    """Eigenvalues and signature of a mesh by one of the methods."""
    if method == "fast":
        # As in the extension: the eigenfunctions of a large mesh are never all in memory.
        return np.zeros(0), wave_kernel_signature_of(mesh, N_PAIRS)
    values, functions = {"eigsh": by_eigsh, "lapy": by_lapy, "exact": by_exact_solver}[method](mesh)
    return values, wave_kernel_signature(values, functions)


def by_exact_solver(mesh: TriangleMesh) -> tuple[FloatArray, FloatArray]:
    """Eigenpairs by our exact solver."""
    return eigenpairs(mesh, N_PAIRS, "exact")


def by_eigsh(mesh: TriangleMesh) -> tuple[FloatArray, FloatArray]:
    """Eigenpairs by SciPy's shift-invert Lanczos, called as in pyFM and the examples of robust_laplacian."""
    from scipy.sparse.linalg import eigsh

    values, functions = eigsh(stiffness_matrix(mesh), N_PAIRS, M=mass_matrix(mesh) / mesh.area, sigma=-0.01)
    return np.maximum(values, 0), functions


def by_lapy(mesh: TriangleMesh) -> tuple[FloatArray, FloatArray]:
    """Eigenpairs by LaPy as pip installs it: SciPy's shift-invert Lanczos with SciPy's sparse factor."""
    from lapy import Solver, TriaMesh

    surface = TriaMesh(mesh.vertices / np.sqrt(mesh.area), mesh.faces)
    values, functions = Solver(surface, lump=True, use_cholmod=False).eigs(N_PAIRS)
    return np.maximum(values, 0), functions


def peak_memory() -> float:
    """Largest resident memory of this process so far, in MB; 0 on systems without /proc."""
    status = Path("/proc/self/status")
    match = re.search(r"VmHWM:\s+(\d+)", status.read_text()) if status.exists() else None
    return int(match[1]) / 1000 if match else 0.0


def main(method: str, source: str, target: str) -> None:
    """Solve; save eigenvalues, signature, seconds, and memory in addition to that of mesh and libraries."""
    with np.load(source) as arrays:
        mesh = TriangleMesh(arrays["vertices"], arrays["faces"])
    before = peak_memory()
    cpu, wall = time.process_time(), time.perf_counter()
    values, signature = solve(method, mesh)
    cpu, wall = time.process_time() - cpu, time.perf_counter() - wall
    memory = peak_memory() - before
    if method == "fast":
        values = eigenpair_panels(mesh, N_PAIRS)[0]  # computed again, since the signature does not return them
    np.savez(target, values=values, signature=signature, cpu=cpu, wall=wall, memory=memory)


if __name__ == "__main__":
    main(*sys.argv[1:])
