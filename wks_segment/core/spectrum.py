"""The first eigenpairs of the Laplace–Beltrami operator, checked after the solve.

Two ways, both on one sparse factorisation that is fast with many right-hand sides (`cholesky`):

"exact"  block Lanczos on the shifted inverse, residuals and orthonormality to 1e-8, and an inertia count that shows
         that no pair was missed.
"fast"   a dense solve in a coarse space (`coarse`), lifted to the surface and corrected there by inverse iteration in
         single precision, until what a correction changes is small.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from scipy.linalg import cholesky, eigh, solve_triangular
from scipy.sparse import csr_matrix, diags, identity
from threadpoolctl import threadpool_limits

from .cholesky import NestedDissectionCholesky, NotPositiveDefiniteError, eigenvalues_below_zero
from .coarse import prolongation
from .laplacian import stiffness_matrix, unit_area_masses
from .mesh import FloatArray, TriangleMesh

Accuracy = Literal["fast", "exact"]

DENSE_BELOW = 600
"""Up to this many vertices the dense solver is faster."""
DENSE_AT_MOST = 4_000
"""Up to this many vertices the dense solver also serves where a large part of all pairs is asked for."""

TOLERANCE = 1e-8
"""exact: largest relative residual, and largest departure from orthonormality."""
ROUNDING = 16 * np.finfo(np.float64).eps
"""What rounding alone leaves of a residual, as a fraction of the operator's norm: felt where triangles are thin."""
MAX_REPAIRS = 5
"""exact: rounds in which missed pairs are looked for, and residuals reduced, before the solve counts as failed."""
BLOCK = 24
"""exact: columns in a block of Lanczos."""
FIRST_LOOK = 3.6
LOOK_AGAIN = 1.12
"""exact: convergence is looked at when there are this many basis vectors a pair, and then this many times more."""
LANCZOS_TOLERANCE = 1e-10
"""exact: residual of the inverse at which Lanczos ends, relative to the value."""
EXACT_SHIFT = 10.0
"""exact: shift of the inverse, of the order of the first eigenvalue of a limbed surface of area 1."""

CELLS_PER_PAIR = 4.5
"""fast: size of the coarse space."""
SPARE_PAIRS = 0.12
"""fast: pairs carried along beyond those asked for, as a fraction of them: the last ones converge slowly."""
FAST_SHIFT = 0.5
"""fast: shift of the inverse for each pair asked for; a small shift would cost single precision its digits."""
LARGEST_CHANGE = 0.03
LARGEST_CHANGE_OF_BOTH = 0.1
"""fast: relative change of a function by a correction, up to which it was the last one; the latter where functions and
corrections together spanned the subspace. The signature is then within 0.1 to 0.4 % of the exact one."""
LEAST_VALUE = 1e-6
"""fast: a first value below this fraction of the last one is rounding, or needs more digits than there are."""
LEAST_DIRECTION = 1e-5
"""fast: squared size of a direction among the corrections, relative to the largest, below which it is rounding."""
MAX_CORRECTIONS = 5
"""fast: corrections before the coarse space is refined, and then before the exact solver takes over."""


class SpectrumError(RuntimeError):
    """The eigenpairs could not be computed to the accuracy asked for."""


# More BLAS threads on blocks this narrow spend their time waiting for each other.
@threadpool_limits.wrap(limits=1, user_api="blas")
def eigenpairs(mesh: TriangleMesh, n_pairs: int = 300, accuracy: Accuracy = "fast") -> tuple[FloatArray, FloatArray]:
    """Compute the first eigenpairs of S φ = λ M φ on the surface scaled to area 1.

    S is the cotangent stiffness matrix, M the lumped mass matrix. Each component of the surface has one zero mode.

    Parameters
    ----------
    mesh : TriangleMesh
        With n vertices, each of them in a face.
    n_pairs : int
        k, the number of pairs with the zero modes, at most n.
    accuracy : "fast" or "exact"
        "exact": relative residuals (beyond rounding, which very thin triangles magnify) and departure from
        mass-orthonormality at most 1e-8, and an inertia count shows that no pair was missed. "fast": as accurate as a
        segmentation needs, the Wave Kernel Signature within a few tenths of a per cent; single precision.

    Returns
    -------
    values : (k,) array of float, rising
        Eigenvalues, without unit since the area is 1. Zero modes are exactly 0.
    functions : (n, k) array of float (float32 from "fast")
        Eigenfunctions, orthonormal under M: φ_iᵀ M φ_j = δ_ij ("fast": to about 1e-3).

    Raises
    ------
    ValueError
        If a parameter is out of range or a vertex belongs to no face.
    SpectrumError
        If the checks after the solve fail.
    """
    if accuracy not in get_args(Accuracy):
        raise ValueError(f"accuracy must be one of {get_args(Accuracy)}, not {accuracy!r}")
    if not 1 <= n_pairs <= mesh.n_vertices:
        raise ValueError(f"n_pairs must be from 1 to the number of vertices ({mesh.n_vertices}), not {n_pairs}")
    stray = np.setdiff1d(np.arange(mesh.n_vertices), mesh.faces)
    if stray.size:
        raise ValueError(f"vertex {stray[0]} belongs to no face ({stray.size} such vertices in all); remove it first")

    problem = _Problem.of(mesh)
    zero_modes = problem.zero_modes()[:, :n_pairs]
    n_rest = n_pairs - zero_modes.shape[1]
    values, vectors = np.zeros(0), np.zeros((mesh.n_vertices, 0))
    if n_rest:
        many_of_all = n_pairs > mesh.n_vertices // 4 and mesh.n_vertices <= DENSE_AT_MOST
        if mesh.n_vertices <= DENSE_BELOW or many_of_all:
            values, vectors = _dense(problem, n_rest)
        elif accuracy == "fast":
            values, vectors = _fast(problem, n_rest)
        else:
            values, vectors = _exact(problem, n_rest)
    values = np.concatenate([np.zeros(zero_modes.shape[1]), values])
    vectors = np.concatenate([zero_modes.astype(vectors.dtype), vectors], axis=1)
    return values, _with_fixed_signs(vectors / problem.root[:, None].astype(vectors.dtype))


@dataclass(frozen=True)
class _Problem:
    """The eigenproblem in standard form: A ψ = λ ψ with A = M^-½ S M^-½ and ψ = M^½ φ."""

    mesh: TriangleMesh
    stiffness: csr_matrix
    root: FloatArray
    operator: csr_matrix

    @classmethod
    def of(cls, mesh: TriangleMesh) -> _Problem:
        unit = TriangleMesh(mesh.vertices / np.sqrt(mesh.area), mesh.faces)
        root = np.sqrt(unit_area_masses(mesh))
        stiffness = csr_matrix(stiffness_matrix(mesh))
        return cls(unit, stiffness, root, csr_matrix(diags(1 / root) @ stiffness @ diags(1 / root)))

    def zero_modes(self) -> FloatArray:
        """(n, c) orthonormal null space: one constant for each component of the mesh."""
        component = self.mesh.components
        modes = np.zeros((len(self.root), int(component.max()) + 1))
        modes[np.arange(len(self.root)), component] = self.root
        return np.asarray(modes / np.linalg.norm(modes, axis=0))

    def shifted(self, shift: float) -> csr_matrix:
        """A + shift."""
        return csr_matrix(self.operator + shift * identity(len(self.root), format="csr"))


def _dense(problem: _Problem, count: int) -> tuple[FloatArray, FloatArray]:
    """All at once, the zero modes lifted out of the way."""
    zero_modes = problem.zero_modes()
    matrix = problem.operator.toarray()
    lift = np.linalg.norm(matrix, ord=np.inf)
    values, vectors = eigh(matrix + lift * zero_modes @ zero_modes.T, subset_by_index=[0, count - 1])
    _check(problem.operator, values, vectors)
    return values, vectors


def _exact(problem: _Problem, count: int) -> tuple[FloatArray, FloatArray]:
    """Block Lanczos; residuals reduced, missed pairs looked for, everything checked."""
    operator, zero_modes = problem.operator, problem.zero_modes()
    try:
        factor = NestedDissectionCholesky(problem.shifted(EXACT_SHIFT), problem.mesh.vertices, np.float64)
    except NotPositiveDefiniteError as error:
        raise SpectrumError(f"the operator cannot be factorised, its triangles are too thin: {error}") from error
    # One pair more, so that the inertia count has a gap to stand in behind the last pair that is handed out.
    vectors = _block_lanczos(factor, zero_modes, count + 1)
    values, vectors = _rayleigh_ritz(operator, vectors, zero_modes)
    for _ in range(MAX_REPAIRS):
        if _residual(operator, values, vectors) <= TOLERANCE:
            break
        # Thin triangles cost Lanczos digits, which inverse iteration of the whole block brings back.
        values, vectors = _rayleigh_ritz(operator, factor.solve(vectors), zero_modes)
    for _ in range(MAX_REPAIRS):
        place = _widest_gap(values, count)
        between = (values[place - 1] + values[place]) / 2
        below = eigenvalues_below_zero(problem.shifted(-between), problem.mesh.vertices)
        missed = below - place - zero_modes.shape[1]
        if missed <= 0:
            break
        more = factor.solve(_block_lanczos(factor, np.hstack([zero_modes, vectors]), missed))
        values, vectors = _rayleigh_ritz(operator, np.hstack([vectors, more]), zero_modes)
    else:
        raise SpectrumError(f"{missed} of {count} eigenpairs were not found")
    values, vectors = values[:count], vectors[:, :count]
    _check(operator, values, vectors)
    return values, vectors


def _block_lanczos(factor: NestedDissectionCholesky, known: FloatArray, count: int) -> FloatArray:
    """(n, count) eigenvectors of the lowest eigenvalues, orthogonal to the `known` vectors.

    In blocks, so that equal eigenvalues are seen, and with full reorthogonalisation, all of it matrix products (Golub
    and Underwood, 1977).
    """
    n = len(known)
    largest = n - known.shape[1]
    width = min(BLOCK, largest)
    next_look = FIRST_LOOK * count
    space = np.empty((n, min(int(next_look) + 2 * width, largest)), order="F")
    projected = np.zeros((0, 0))
    block = factor.solve(np.random.default_rng(0).standard_normal((n, width)))
    block, coupling = _orthonormal_to(known, block), np.zeros((width, width))
    while True:
        old, size = len(projected), len(projected) + width
        if size > space.shape[1]:
            space = np.concatenate([space, np.empty((n, space.shape[1] // 4 + width), order="F")], axis=1)
        space[:, old:size] = block
        basis = space[:, :size]
        image = factor.solve(block)
        # In exact arithmetic only the last two blocks are left in the image: a block tridiagonal matrix.
        diagonal = block.T @ image
        projected = np.pad(projected, (0, width))
        projected[old:, old:] = (diagonal + diagonal.T) / 2
        image -= block @ diagonal
        if old:
            projected[old:, old - width : old] = coupling
            projected[old - width : old, old:] = coupling.T
            image -= space[:, old - width : old] @ coupling.T
        # Rounding brings all others back in.
        image -= known @ (known.T @ image)
        image -= basis @ (basis.T @ image)
        block, coupling = np.linalg.qr(image)
        exhausted = size + width > largest
        if exhausted or size >= next_look:
            next_look *= LOOK_AGAIN
            ritz, weights = np.linalg.eigh(projected)
            ritz, weights = ritz[-count:], np.ascontiguousarray(weights[:, -count:])
            # Residual of each Ritz pair: what the next block still couples to it.
            left = np.linalg.norm(coupling @ weights[-width:], axis=0)
            if exhausted or (left <= LANCZOS_TOLERANCE * ritz).all():
                return basis @ weights


def _orthonormal_to(basis: FloatArray, block: FloatArray) -> FloatArray:
    """Orthonormal columns that span a block beside an orthonormal basis; twice is enough (Kahan and Parlett)."""
    for _ in range(2):
        block = np.linalg.qr(block - basis @ (basis.T @ block))[0]
    return block


def _rayleigh_ritz(operator: csr_matrix, basis: FloatArray, known: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Best eigenpairs of A within the span of a basis, orthogonal to the `known` vectors."""
    basis = basis - known @ (known.T @ basis)
    values, rotation = eigh(basis.T @ (operator @ basis), basis.T @ basis)
    return values, basis @ rotation


def _widest_gap(values: FloatArray, count: int) -> int:
    """Index behind which the values jump most, at or after the last pair that is handed out.

    A count between two almost equal eigenvalues would depend on rounding.
    """
    return count + int(np.argmax(np.diff(values[count - 1 :])))


def _residual(operator: csr_matrix, values: FloatArray, vectors: FloatArray) -> float:
    """Largest relative residual ‖A ψ − λ ψ‖ / λ, beyond what rounding explains."""
    # A first eigenvalue far below 1 (parts that hang by a thread) is measured against 1.
    rounding = ROUNDING * abs(operator).sum(axis=0).max()
    residuals = np.linalg.norm(operator @ vectors - vectors * values, axis=0)
    return float((np.maximum(residuals - rounding, 0) / np.maximum(values, 1)).max())


def _check(operator: csr_matrix, values: FloatArray, vectors: FloatArray) -> None:
    """Raise SpectrumError unless the pairs are pairs and the vectors orthonormal."""
    residual = _residual(operator, values, vectors)
    departure = np.abs(vectors.T @ vectors - np.eye(len(values))).max()
    if not max(residual, departure) <= TOLERANCE:
        raise SpectrumError(
            f"the eigenpairs are not accurate enough: relative residual {residual:.1e}, departure from "
            f"orthonormality {departure:.1e}, allowed {TOLERANCE:.0e}"
        )


def _fast(problem: _Problem, count: int) -> tuple[FloatArray, FloatArray]:
    """A coarse solve, corrected on the surface until corrections are small; the exact solver where they stay large."""
    n_cells = round(CELLS_PER_PAIR * count)
    tried = False
    try:
        factor = NestedDissectionCholesky(problem.shifted(FAST_SHIFT * count), problem.mesh.vertices, np.float32)
        while 2 * n_cells < len(problem.root):
            tried = True
            coarse = _coarse_pairs(problem, count, n_cells)
            values, vectors, converged = _correct(problem, factor, *coarse, count)
            if converged and values[0] > LEAST_VALUE * values[-1]:
                return values, vectors
            n_cells *= 2
    except NotPositiveDefiniteError:
        tried = True  # triangles too thin for single precision
    if tried:
        warnings.warn("the fast eigensolver did not converge on this mesh; used the exact one", stacklevel=2)
    values, vectors = _exact(problem, count)
    return values, vectors.astype(np.float32)


def _coarse_pairs(problem: _Problem, count: int, n_cells: int) -> tuple[FloatArray, FloatArray]:
    """Non-zero eigenpairs of the problem restricted to the coarse space (Galerkin), lifted to the surface."""
    n_zero = int(problem.mesh.components.max()) + 1
    masses = problem.root**2
    basis = prolongation(problem.mesh, masses, problem.stiffness, n_cells).astype(np.float32)
    scaled = diags(problem.root.astype(np.float32)) @ basis
    stiffness = (basis.T @ (problem.stiffness.astype(np.float32) @ basis)).toarray()
    mass = (scaled.T @ scaled).toarray()
    mass[np.diag_indices_from(mass)] *= 1 + np.finfo(np.float32).eps
    carried = min(len(mass), n_zero + round((1 + SPARE_PAIRS) * count))
    factor = cholesky(mass, lower=True)
    reduced = solve_triangular(factor, solve_triangular(factor, stiffness, lower=True).T, lower=True)
    values, weights = eigh((reduced + reduced.T) / 2, subset_by_index=[0, carried - 1])
    weights = solve_triangular(factor, weights[:, n_zero:], lower=True, trans="T")
    return values[n_zero:].astype(np.float64), scaled @ np.ascontiguousarray(weights)


def _correct(
    problem: _Problem, factor: NestedDissectionCholesky, values: FloatArray, vectors: FloatArray, count: int
) -> tuple[FloatArray, FloatArray, bool]:
    """Inverse iteration in the form of corrections ψ ← ψ − (A + shift)⁻¹ (A ψ − λ ψ), each with Rayleigh–Ritz.

    In single precision: a correction needs few digits, and its size tells how far the functions were off. Where it is
    large, functions and corrections together span the next subspace, which finds modes that the coarse space hardly
    held (on thin and loose parts). Returns whether it converged.
    """
    operator = problem.operator.astype(np.float32)
    zero_modes = problem.zero_modes().astype(np.float32)
    for step in range(MAX_CORRECTIONS):
        residual = operator @ vectors
        residual -= vectors * values.astype(np.float32)
        correction = factor.solve(residual)
        correction -= zero_modes @ (zero_modes.T @ correction)
        change = float(np.linalg.norm(correction[:, :count], axis=0).max())
        both = step > 0 and change > LARGEST_CHANGE
        if both:
            basis = np.hstack([vectors, _orthonormal_part(correction, vectors)])
        else:
            basis = vectors
            basis -= correction
            if change <= LARGEST_CHANGE:
                # The residual of a Ritz vector is orthogonal to all others, and so nearly is its correction.
                return *_normalised(operator, basis[:, :count]), True
        gram = (basis.T @ basis).astype(np.float64)
        energy = (basis.T @ (operator @ basis)).astype(np.float64)
        values, rotation = eigh((energy + energy.T) / 2, gram, subset_by_index=[0, vectors.shape[1] - 1])
        vectors = basis @ rotation.astype(np.float32)
        if both and change <= LARGEST_CHANGE_OF_BOTH:
            return values[:count], vectors[:, :count], True
    return values[:count], vectors[:, :count], False


def _normalised(operator: csr_matrix, vectors: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Vectors scaled to length 1 and in the order of their Rayleigh quotients, which come with them."""
    squares = np.einsum("ij,ij->j", vectors, vectors, dtype=np.float64)
    values = np.einsum("ij,ij->j", vectors, operator @ vectors, dtype=np.float64) / squares
    order = np.argsort(values, kind="stable")
    return values[order], vectors[:, order] / np.sqrt(squares[order]).astype(np.float32)


def _orthonormal_part(block: FloatArray, basis: FloatArray) -> FloatArray:
    """Orthonormal columns for what a block has beside an orthonormal basis, without what is only rounding."""
    block = block - basis @ (basis.T @ block)
    squares, directions = np.linalg.eigh((block.T @ block).astype(np.float64))
    kept = squares > LEAST_DIRECTION * squares[-1]
    return block @ (directions[:, kept] / np.sqrt(squares[kept])).astype(np.float32)


def _with_fixed_signs(functions: FloatArray) -> FloatArray:
    """Flip each function so that its largest entry is positive: the same result on every machine."""
    functions *= np.where(functions.max(axis=0) < -functions.min(axis=0), -1, 1).astype(functions.dtype)
    return functions
