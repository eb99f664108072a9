"""The first eigenpairs of the Laplace–Beltrami operator, checked after the solve.

Both ways to compute them use a sparse factorization that is fast with many right-hand sides (`multifrontal`):

"exact"  block Lanczos on a shifted inverse (`lanczos`), residuals and orthonormality to 1e-8, and an inertia count that
         shows that no pair was missed.
"fast"   a dense solve in a coarse space, carried to the surface and corrected there in single precision until a
         correction changes little (`multilevel`).
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from scipy.linalg import eigh
from scipy.sparse import csr_matrix, diags

from ..mesh.triangle_mesh import FloatArray, IntArray, TriangleMesh
from ..message import Message
from ..progress import Progress
from ..threads import one_blas_thread
from .coarsening import Level
from .lanczos import SpectrumError, check_eigenpairs, lanczos_eigenpairs
from .laplacian import stiffness_matrix, unit_area_masses
from .memory import available_memory
from .multilevel import (
    CELL_LEVEL_ABOVE,
    MIDDLE_CELLS_PER_PAIR,
    NotConvergedError,
    SpectrumWarning,
    multilevel_eigenpairs,
)

__all__ = ["Accuracy", "SpectrumError", "SpectrumWarning", "eigenpair_panels", "eigenpairs", "memory_needed"]

Accuracy = Literal["fast", "exact"]
Panels = Iterator[tuple[slice, FloatArray]]
"""Eigenfunctions in rising order: a slice of columns, and an (n, number of columns) array. To be read once."""

DENSE_BELOW = 600
"""Number of vertices up to which the dense solver is faster."""
DENSE_AT_MOST = 4_000
"""Number of vertices up to which the dense solver is used if a large part of all pairs is asked for."""
CURVE_BITS = 10
"""Bits for each coordinate along the curve by which vertices are sorted: 1024 steps along the longest side."""
TRIED = 0.95
"""Share of the progress that stands when the fast solver has failed and the exact one begins."""


@one_blas_thread
def eigenpairs(
    mesh: TriangleMesh,
    n_pairs: int = 300,
    accuracy: Accuracy = "fast",
    progress: Callable[[float], None] | Progress | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Compute the first eigenpairs of S φ = λ M φ on the surface scaled to area 1.

    S is the cotangent stiffness matrix, M the lumped mass matrix. Each island of the surface has one zero mode.

    Parameters
    ----------
    mesh : TriangleMesh
        With n vertices, each of them in a face.
    n_pairs : int
        k, the number of pairs, zero modes included. A mesh with fewer vertices has only n pairs, with a warning.
    accuracy : "fast" or "exact"
        "exact": relative residuals (beyond rounding, which very thin triangles amplify) and departure from
        mass-orthonormality are at most 1e-8, and an inertia count shows that no pair was missed. "fast": as accurate as
        a segmentation needs, the Wave Kernel Signature within a few tenths of a percent; single precision.
    progress : callable, optional
        Called with the share of the solve that is done, 0 to 1. An error that it raises ends the solve.

    Returns
    -------
    values : (k,) array of float, rising
        Eigenvalues, without unit since the area is 1. Zero modes are exactly 0.
    functions : (n, k) array of float (float32 from "fast", except for small meshes)
        Eigenfunctions, orthonormal under M: φ_iᵀ M φ_j = δ_ij ("fast": to about 1e-2).

    Raises
    ------
    ValueError
        If a parameter is out of range or a vertex belongs to no face.
    SpectrumError
        If the checks after the solve fail.
    MemoryError
        If the solve needs more memory than is free; the message gives both figures.

    Examples
    --------
    >>> from examples.tube import tube
    >>> from wks_segment.core import eigenpairs
    >>> values, functions = eigenpairs(tube(0.5), n_pairs=20)
    >>> values.shape, functions.shape
    ((20,), (290, 20))
    >>> bool(abs(values[0]) < 1e-6)  # the constant function
    True
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
    progress: Callable[[float], None] | Progress | None = None,
) -> tuple[FloatArray, IntArray, Panels]:
    """The same as `eigenpairs`, the functions in panels of columns, so that they are not all in memory at once.

    The panels are computed while they are read, so whoever reads them should limit BLAS to one thread.

    Returns
    -------
    values : (k,) array of float, rising
    place : (n,) array of int
        Row of the panels that belongs to each vertex of the mesh.
    panels : Panels
        The signs of the functions are arbitrary.
    """
    if accuracy not in get_args(Accuracy):
        raise ValueError(
            Message("accuracy must be one of {allowed}, not {value!r}", allowed=get_args(Accuracy), value=accuracy)
        )
    if n_pairs < 1:
        raise ValueError(Message("n_pairs must be at least 1, not {value!r}", value=n_pairs))
    if n_pairs > mesh.n_vertices:
        text = Message("the mesh has only {count} vertices, so only {count} eigenpairs exist", count=mesh.n_vertices)
        warnings.warn(text, SpectrumWarning, stacklevel=4)
        n_pairs = mesh.n_vertices
    used = np.zeros(mesh.n_vertices, dtype=bool)
    used[mesh.faces] = True
    unused = np.flatnonzero(~used)
    if unused.size:
        raise ValueError(
            Message(
                "vertex {vertex} belongs to no face ({count} such vertices in all); remove it first",
                vertex=unused[0],
                count=unused.size,
            )
        )
    _check_memory(mesh.n_vertices, n_pairs, accuracy)
    problem, report = _Problem.of(mesh), Progress.of_share(progress).never_falling()
    values, panels = _solve_problem(problem, n_pairs, accuracy, report)
    return values, problem.place, _reported_to_the_end(panels, report)


def _check_memory(n_vertices: int, n_pairs: int, accuracy: Accuracy) -> None:
    """Raise MemoryError, with both figures, if a solve needs more memory than is free."""
    needed, free = memory_needed(n_vertices, n_pairs, accuracy), available_memory()
    if needed > free:
        raise MemoryError(
            Message(
                "{n_pairs} eigenpairs of {n_vertices:,} vertices ({accuracy}) need about {needed:,.0f} MB of memory, "
                "but only {free:,.0f} MB are free: close other programs, compute fewer pairs or use a coarser mesh",
                n_pairs=n_pairs,
                n_vertices=n_vertices,
                accuracy=accuracy,
                needed=needed / 1e6,
                free=free / 1e6,
            )
        )


def memory_needed(n_vertices: int, n_pairs: int, accuracy: Accuracy) -> int:
    """Rough peak memory of a solve in bytes, without the mesh; measured from 5,000 to 1,000,000 vertices."""
    if accuracy == "exact":
        return n_vertices * (2_000 + 46 * n_pairs)
    if n_vertices <= CELL_LEVEL_ABOVE:
        return n_vertices * (2_500 + 13 * n_pairs) + 600 * n_pairs**2
    return n_vertices * 1_900 + MIDDLE_CELLS_PER_PAIR * n_pairs * (2_500 + 10 * n_pairs)


def seconds_needed(n_vertices: int, n_pairs: int, accuracy: Accuracy) -> float:
    """Rough duration of a solve on one core of the year 2025; measured from 5,000 to 1,000,000 vertices."""
    share = n_pairs / 300
    if accuracy == "exact":
        return 3.2 * (n_vertices / 20_000) ** 1.18 * share**1.5
    # With many pairs, products of dense matrices take most of the time: 35 s for 1500 pairs, 135 s for 2000.
    many = 8e-10 * min(n_vertices, CELL_LEVEL_ABOVE) * max(n_pairs - 300, 0) ** 2
    if n_vertices <= CELL_LEVEL_ABOVE:
        return (0.3 + 3.6e-5 * n_vertices) * share**1.2 + many
    return (6 + 1e-5 * n_vertices) * share**1.2 + many


def _reported_to_the_end(panels: Panels, progress: Progress) -> Panels:
    """The same panels; the end is reported when all have been read."""
    yield from panels
    progress(1.0)


@dataclass(frozen=True)
class _Problem:
    """Eigenproblem on the surface of area 1, its vertices sorted so that neighbors are near to each other in memory.

    Attributes
    ----------
    mesh : TriangleMesh
    place : (n,) int array
        Number in `mesh` of each vertex of the mesh that was given.
    """

    mesh: TriangleMesh
    place: IntArray

    @classmethod
    def of(cls, mesh: TriangleMesh) -> _Problem:
        """Eigenproblem of a mesh of any area."""
        order = _along_curve(mesh.vertices)
        place = np.empty_like(order)
        place[order] = np.arange(len(order))
        return cls(mesh.with_unit_area(place), place)

    def operator(self) -> csr_matrix:
        """A = M^-½ S M^-½ of the standard form A ψ = λ ψ, ψ = M^½ φ."""
        inverse_root = diags(1 / self.mass_roots())
        return csr_matrix(inverse_root @ stiffness_matrix(self.mesh) @ inverse_root)

    def mass_roots(self) -> FloatArray:
        """(n,) square roots of the masses."""
        return np.asarray(np.sqrt(unit_area_masses(self.mesh)))

    def zero_modes(self) -> FloatArray:
        """(n, c) orthonormal null space of A: a constant function on each of c islands."""
        island = self.mesh.islands
        modes = np.zeros((len(island), int(island.max()) + 1))
        modes[np.arange(len(island)), island] = self.mass_roots()
        return np.asarray(modes / np.linalg.norm(modes, axis=0))


def _along_curve(vertices: FloatArray) -> IntArray:
    """(n,) vertices in their order along Morton's curve."""
    extent = np.ptp(vertices, axis=0).max()
    steps = ((vertices - vertices.min(axis=0)) * ((2**CURVE_BITS - 1) / extent)).astype(np.int64)
    code = np.zeros(len(vertices), dtype=np.int64)
    for bit in range(CURVE_BITS):
        for axis in range(3):
            code |= (steps[:, axis] >> bit & 1) << (3 * bit + axis)
    return np.argsort(code, kind="stable")


def _solve_problem(
    problem: _Problem, n_pairs: int, accuracy: Accuracy, progress: Progress
) -> tuple[FloatArray, Panels]:
    """Eigenvalues, and panels of functions at the vertices of the problem."""
    n = problem.mesh.n_vertices
    zero_modes = problem.zero_modes()[:, :n_pairs]
    n_zero = zero_modes.shape[1]
    count = n_pairs - n_zero
    tried = 0.0
    dense = n <= DENSE_BELOW or (n_pairs > n // 9 and n <= DENSE_AT_MOST)
    if count and not dense and accuracy == "fast":
        try:
            values, panels = multilevel_eigenpairs(Level.of(problem.mesh), count, n_zero, progress)
            constants: FloatArray = (zero_modes / problem.mass_roots()[:, None]).astype(np.float32)
            return np.concatenate([np.zeros(n_zero), values]), _prepended(constants, panels)
        except NotConvergedError:
            text = "the fast eigensolver did not converge on this mesh, so the exact one was used"
            warnings.warn(text, SpectrumWarning, stacklevel=5)
            _check_memory(n, n_pairs, "exact")
            tried = TRIED
    values, vectors = np.zeros(0), np.zeros((n, 0))
    if count and dense:
        values, vectors = _solve_densely(problem.operator(), zero_modes, count)
    elif count:
        values, vectors = lanczos_eigenpairs(
            problem.operator(), Level.of(problem.mesh), zero_modes, count, progress.part(tried, 1.0)
        )
    functions = np.concatenate([zero_modes, vectors], axis=1)
    functions /= problem.mass_roots()[:, None]
    return np.concatenate([np.zeros(n_zero), values]), _prepended(functions, iter(()))


def _prepended(first: FloatArray, panels: Panels) -> Panels:
    """The first functions as a panel, followed by panels of the other functions."""
    width = first.shape[1]
    yield slice(0, width), first
    for columns, panel in panels:
        yield slice(columns.start + width, columns.stop + width), panel


def _solve_densely(operator: csr_matrix, zero_modes: FloatArray, count: int) -> tuple[FloatArray, FloatArray]:
    """The lowest eigenpairs besides the zero modes, which are shifted above all others."""
    matrix = operator.toarray()
    shift = np.linalg.norm(matrix, ord=np.inf)
    values, vectors = eigh(matrix + shift * zero_modes @ zero_modes.T, subset_by_index=[0, count - 1])
    check_eigenpairs(operator, values, vectors)
    return values, vectors


def _with_fixed_signs(functions: FloatArray) -> FloatArray:
    """Flip functions in place so that the entry of largest magnitude is positive: the same result on every machine."""
    functions *= np.where(functions.max(axis=0) < -functions.min(axis=0), -1, 1).astype(functions.dtype)
    return functions
