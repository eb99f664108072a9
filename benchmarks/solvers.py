"""One eigensolver on one mesh in a process of its own: `python -m benchmarks.solvers METHOD MESH.npz RESULT.npz`.

Each method goes from a mesh to its Wave Kernel Signature: 300 pairs, 100 energies, surface scaled to area 1.
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
    """Eigenvalues and signature."""
    if method == "fast":
        # As the extension does it: of a large mesh the functions are never all in memory.
        return np.zeros(0), wave_kernel_signature_of(mesh, N_PAIRS)
    values, functions = {"eigsh": by_eigsh, "lapy": by_lapy, "exact": by_lanczos}[method](mesh)
    return values, wave_kernel_signature(values, functions)


def by_lanczos(mesh: TriangleMesh) -> tuple[FloatArray, FloatArray]:
    """Ours."""
    return eigenpairs(mesh, N_PAIRS, "exact")


def by_eigsh(mesh: TriangleMesh) -> tuple[FloatArray, FloatArray]:
    """SciPy's shift-invert Lanczos, as pyFM and the examples of robust_laplacian call it."""
    from scipy.sparse.linalg import eigsh

    values, functions = eigsh(stiffness_matrix(mesh), N_PAIRS, M=mass_matrix(mesh) / mesh.area, sigma=-0.01)
    return np.maximum(values, 0), functions


def by_lapy(mesh: TriangleMesh) -> tuple[FloatArray, FloatArray]:
    """LaPy with what pip installs: SciPy's shift-invert Lanczos on a factor of its own."""
    from lapy import Solver, TriaMesh

    surface = TriaMesh(mesh.vertices / np.sqrt(mesh.area), mesh.faces)
    values, functions = Solver(surface, lump=True, use_cholmod=False).eigs(N_PAIRS)
    return np.maximum(values, 0), functions


def peak_memory() -> float:
    """Most memory that this process has had so far, in MB; 0 where the system does not tell."""
    status = Path("/proc/self/status")
    found = re.search(r"VmHWM:\s+(\d+)", status.read_text()) if status.exists() else None
    return int(found[1]) / 1000 if found else 0.0


def main(method: str, source: str, target: str) -> None:
    """Solve and save eigenvalues, signature, seconds and memory beyond what the mesh and the libraries take."""
    with np.load(source) as arrays:
        mesh = TriangleMesh(arrays["vertices"], arrays["faces"])
    before = peak_memory()
    cpu, wall = time.process_time(), time.perf_counter()
    values, signature = solve(method, mesh)
    cpu, wall = time.process_time() - cpu, time.perf_counter() - wall
    memory = peak_memory() - before
    if method == "fast":
        values = eigenpair_panels(mesh, N_PAIRS)[0]  # once more, since the signature keeps them for itself
    np.savez(target, values=values, signature=signature, cpu=cpu, wall=wall, memory=memory)


if __name__ == "__main__":
    main(*sys.argv[1:])
