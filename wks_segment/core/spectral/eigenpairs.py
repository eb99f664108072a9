"""The first eigenpairs of the Laplace–Beltrami operator, checked after the solve.

Two ways, both on one sparse factorization that is fast with many right-hand sides (`factor`):

"exact"  block Lanczos on a shifted inverse (`lanczos`), residuals and orthonormality to 1e-8, and an inertia count that
         shows that no pair was missed.
"fast"   a dense solve in a coarse space, lifted to the surface and corrected there in single precision until what a
         correction changes is small (`hierarchy`).
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from scipy.linalg import eigh
from scipy.sparse import csr_matrix, diags
from threadpoolctl import threadpool_limits

from ..mesh.triangle_mesh import FloatArray, IntArray, TriangleMesh
from .coarsening import Level
from .lanczos import SpectrumError, check, lanczos_eigenpairs
from .laplacian import stiffness_matrix, unit_area_masses
from .memory import available_memory
from .multilevel import LARGE, MIDDLE_CELLS_PER_PAIR, NotConvergedError, SpectrumWarning, hierarchical_eigenpairs

__all__ = ["Accuracy", "SpectrumError", "SpectrumWarning", "eigenpair_panels", "eigenpairs", "memory_needed"]

Accuracy = Literal["fast", "exact"]
Panels = Iterator[tuple[slice, FloatArray]]

DENSE_BELOW = 600
"""Up to this many vertices the dense solver is faster."""
DENSE_AT_MOST = 4_000
"""Up to this many vertices the dense solver also serves where a large part of all pairs is asked for."""
CURVE_BITS = 10
"""Bits a coordinate along the curve that vertices are sorted by."""


def eigenpairs(
    mesh: TriangleMesh,
    n_pairs: int = 300,
    accuracy: Accuracy = "fast",
    progress: Callable[[float], None] | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Compute the first eigenpairs of S φ = λ M φ on the surface scaled to area 1.

    S is the cotangent stiffness matrix, M the lumped mass matrix. Each component of the surface has one zero mode.

    Parameters
    ----------
    mesh : TriangleMesh
        With n vertices, each of them in a face.
    n_pairs : int
        k, the number of pairs with the zero modes. A mesh with fewer vertices has only n, with a warning.
    accuracy : "fast" or "exact"
        "exact": relative residuals (beyond rounding, which very thin triangles magnify) and departure from
        mass-orthonormality at most 1e-8, and an inertia count shows that no pair was missed. "fast": as accurate as a
        segmentation needs, the Wave Kernel Signature within a few tenths of a percent; single precision.
    progress : callable, optional
        Called with the share of the work that is done, 0 to 1. An error that it raises ends the solve.

    Returns
    -------
    values : (k,) array of float, rising
        Eigenvalues, without unit since the area is 1. Zero modes are exactly 0.
    functions : (n, k) array of float (float32 from "fast", but for small meshes)
        Eigenfunctions, orthonormal under M: φ_iᵀ M φ_j = δ_ij ("fast": to about 1e-2).

    Raises
    ------
    ValueError
        If a parameter is out of range or a vertex belongs to no face.
    SpectrumError
        If the checks after the solve fail.
    MemoryError
        If less is free than the solve needs; the message says both.
    """
    values, place, panels = eigenpair_panels(mesh, n_pairs, accuracy, progress)
    functions: FloatArray | None = None
    for columns, panel in panels:
        if functions is None:
            functions = np.empty((mesh.n_vertices, len(values)), dtype=panel.dtype)
        functions[:, columns] = _with_fixed_signs(panel[place])
    assert functions is not None
    return values, functions


def eigenpair_panels(
    mesh: TriangleMesh,
    n_pairs: int = 300,
    accuracy: Accuracy = "fast",
    progress: Callable[[float], None] | None = None,
) -> tuple[FloatArray, IntArray, Panels]:
    """As `eigenpairs`, the functions a panel of columns at a time, so that they need not all be in memory at once.

    Returns
    -------
    values : (k,) array of float, rising
    place : (n,) array of int
        Row of the panels that belongs to each vertex of the mesh.
    panels : iterator over pairs of a slice of columns and an array (n, number of columns)
        In rising order, to be read once; signs as they come.
    """
    if accuracy not in get_args(Accuracy):
        raise ValueError(f"accuracy must be one of {get_args(Accuracy)}, not {accuracy!r}")
    if n_pairs < 1:
        raise ValueError(f"n_pairs must be at least 1, not {n_pairs}")
    if n_pairs > mesh.n_vertices:
        warnings.warn(
            f"the mesh has only {mesh.n_vertices} vertices, and so many eigenpairs", SpectrumWarning, stacklevel=3
        )
        n_pairs = mesh.n_vertices
    used = np.zeros(mesh.n_vertices, dtype=bool)
    used[mesh.faces] = True
    stray = np.flatnonzero(~used)
    if stray.size:
        raise ValueError(f"vertex {stray[0]} belongs to no face ({stray.size} such vertices in all); remove it first")
    _check_memory(mesh.n_vertices, n_pairs, accuracy)
    problem, tick = _Problem.of(mesh), _rising(progress)
    values, panels = _solved(problem, n_pairs, accuracy, tick)
    return values, problem.place, _on_one_thread(panels, tick)


def _check_memory(n_vertices: int, n_pairs: int, accuracy: Accuracy) -> None:
    """Raise MemoryError, with both figures, if less is free than a solve needs."""
    needed, free = memory_needed(n_vertices, n_pairs, accuracy), available_memory()
    if needed > free:
        raise MemoryError(
            f"{n_pairs} eigenpairs of {n_vertices:,} vertices ({accuracy}) need about {needed / 1e6:,.0f} MB of "
            f"memory, and {free / 1e6:,.0f} MB are free: close other programs, or take fewer pairs or a coarser mesh"
        )


def _rising(progress: Callable[[float], None] | None) -> Callable[[float], None]:
    """Progress that stays where it is when a solve has to start again."""
    reached = 0.0

    def tick(share: float) -> None:
        nonlocal reached
        reached = max(reached, share)
        if progress:
            progress(reached)

    return tick


def memory_needed(n_vertices: int, n_pairs: int, accuracy: Accuracy) -> int:
    """Bytes that a solve takes at its peak beside the mesh, roughly, as measured from 5,000 to 1,000,000 vertices."""
    if accuracy == "exact":
        return n_vertices * (2_000 + 46 * n_pairs)
    if n_vertices <= LARGE:
        return n_vertices * (2_500 + 13 * n_pairs) + 600 * n_pairs**2
    return n_vertices * 1_900 + MIDDLE_CELLS_PER_PAIR * n_pairs * (2_500 + 10 * n_pairs)


def seconds_needed(n_vertices: int, n_pairs: int, accuracy: Accuracy) -> float:
    """Time that a solve takes, roughly, as measured from 5,000 to 1,000,000 vertices on one core of the year 2025."""
    share = n_pairs / 300
    if accuracy == "exact":
        return 3.2 * (n_vertices / 20_000) ** 1.18 * share**1.5
    if n_vertices <= LARGE:
        return (0.3 + 3.6e-5 * n_vertices) * share**1.2
    return (6 + 1e-5 * n_vertices) * share**1.2


def _on_one_thread(panels: Panels, tick: Callable[[float], None]) -> Panels:
    """The same panels, each computed on one BLAS thread."""
    while True:
        with threadpool_limits(1, "blas"):
            panel = next(panels, None)
        if panel is None:
            break
        yield panel
    tick(1.0)


@dataclass(frozen=True)
class _Problem:
    """The surface of area 1, its vertices along a curve through space: neighbors are near to each other in memory.

    `place` is the place of each vertex of the mesh along the curve.
    """

    mesh: TriangleMesh
    place: IntArray

    @classmethod
    def of(cls, mesh: TriangleMesh) -> _Problem:
        order = _along_a_curve(mesh.vertices)
        place = np.empty_like(order)
        place[order] = np.arange(len(order))
        return cls(mesh.with_unit_area(place), place)

    def operator(self) -> csr_matrix:
        """A = M^-½ S M^-½ of the standard form A ψ = λ ψ, ψ = M^½ φ."""
        inverse_root = diags(1 / self.root())
        return csr_matrix(inverse_root @ stiffness_matrix(self.mesh) @ inverse_root)

    def root(self) -> FloatArray:
        """(n,) square roots of the masses."""
        return np.asarray(np.sqrt(unit_area_masses(self.mesh)))

    def zero_modes(self) -> FloatArray:
        """(n, c) orthonormal null space of A: one constant for each component of the mesh."""
        component = self.mesh.components
        modes = np.zeros((len(component), int(component.max()) + 1))
        modes[np.arange(len(component)), component] = self.root()
        return np.asarray(modes / np.linalg.norm(modes, axis=0))


def _along_a_curve(vertices: FloatArray) -> IntArray:
    """Order of the vertices along Morton's curve."""
    extent = np.ptp(vertices, axis=0).max()
    steps = ((vertices - vertices.min(axis=0)) * ((2**CURVE_BITS - 1) / extent)).astype(np.int64)
    code = np.zeros(len(vertices), dtype=np.int64)
    for bit in range(CURVE_BITS):
        for axis in range(3):
            code |= (steps[:, axis] >> bit & 1) << (3 * bit + axis)
    return np.argsort(code, kind="stable")


@threadpool_limits.wrap(limits=1, user_api="blas")  # more threads on blocks this narrow wait for each other
def _solved(
    problem: _Problem, n_pairs: int, accuracy: Accuracy, tick: Callable[[float], None]
) -> tuple[FloatArray, Panels]:
    """Values, and panels of functions along the curve."""
    n = problem.mesh.n_vertices
    zero_modes = problem.zero_modes()[:, :n_pairs]
    n_zero = zero_modes.shape[1]
    count = n_pairs - n_zero
    dense = n <= DENSE_BELOW or (n_pairs > n // 9 and n <= DENSE_AT_MOST)
    if count and not dense and accuracy == "fast":
        try:
            values, panels = hierarchical_eigenpairs(Level.of(problem.mesh), count, n_zero, tick)
            constants: FloatArray = (zero_modes / problem.root()[:, None]).astype(np.float32)
            return np.concatenate([np.zeros(n_zero), values]), _behind(constants, panels)
        except NotConvergedError:
            text = "the fast eigensolver did not converge on this mesh; used the exact one"
            warnings.warn(text, SpectrumWarning, stacklevel=5)
            _check_memory(n, n_pairs, "exact")
    values, vectors = np.zeros(0), np.zeros((n, 0))
    if count and dense:
        values, vectors = _dense(problem.operator(), zero_modes, count)
    elif count:
        values, vectors = lanczos_eigenpairs(problem.operator(), Level.of(problem.mesh), zero_modes, count, tick)
    functions = np.concatenate([zero_modes, vectors], axis=1)
    functions /= problem.root()[:, None]
    return np.concatenate([np.zeros(n_zero), values]), _behind(functions, iter(()))


def _behind(first: FloatArray, panels: Panels) -> Panels:
    """A panel that is known already, and those that follow it."""
    width = first.shape[1]
    yield slice(0, width), first
    for columns, panel in panels:
        yield slice(columns.start + width, columns.stop + width), panel


def _dense(operator: csr_matrix, zero_modes: FloatArray, count: int) -> tuple[FloatArray, FloatArray]:
    """All at once, the zero modes lifted out of the way."""
    matrix = operator.toarray()
    lift = np.linalg.norm(matrix, ord=np.inf)
    values, vectors = eigh(matrix + lift * zero_modes @ zero_modes.T, subset_by_index=[0, count - 1])
    check(operator, values, vectors)
    return values, vectors


def _with_fixed_signs(functions: FloatArray) -> FloatArray:
    """Flip each function so that its largest entry is positive: the same result on every machine."""
    functions *= np.where(functions.max(axis=0) < -functions.min(axis=0), -1, 1).astype(functions.dtype)
    return functions
