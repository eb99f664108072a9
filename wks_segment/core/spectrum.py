"""The first eigenpairs of the Laplace–Beltrami operator, checked after the solve."""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np
from scipy.linalg import eigh
from scipy.sparse import csc_matrix, csr_matrix, diags
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import LinearOperator, SuperLU, eigsh, splu
from threadpoolctl import threadpool_limits

from .laplacian import stiffness_matrix, unit_area_masses
from .mesh import FloatArray, IntArray, TriangleMesh

Accuracy = Literal["fast", "exact"]

TOLERANCE = 1e-8
"""Largest relative residual, and largest departure from orthonormality, of a pair that is handed out."""
SHIFT = 10.0
"""Shift of the inverse, of the order of the first eigenvalue of a limbed surface of area 1."""
DENSE_BELOW = 600
"""Up to this many vertices the dense solver is faster."""
ROUNDING = 16 * np.finfo(np.float64).eps
"""What rounding alone leaves of a residual, as a fraction of the operator's norm: felt where triangles are thin."""
MAX_REPAIRS = 5
"""Rounds in which missed pairs are looked for, and residuals reduced, before the solve counts as failed."""


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
        mass-orthonormality at most 1e-8, and an inertia count shows that no pair was missed. "fast" is the same in
        this version.

    Returns
    -------
    values : (k,) array of float, rising
        Eigenvalues, without unit since the area is 1. Zero modes are exactly 0.
    functions : (n, k) array of float
        Eigenfunctions, orthonormal under M: φ_iᵀ M φ_j = δ_ij.

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

    masses = unit_area_masses(mesh)
    root = np.sqrt(masses)
    stiffness = stiffness_matrix(mesh)
    # With ψ = √M φ the problem is a standard one: A ψ = λ ψ.
    operator = csc_matrix(diags(1 / root) @ stiffness @ diags(1 / root))
    zero_modes = _zero_modes(stiffness, root)
    if n_pairs <= zero_modes.shape[1]:
        values, vectors = np.zeros(n_pairs), zero_modes[:, :n_pairs]
    elif mesh.n_vertices <= DENSE_BELOW or n_pairs > mesh.n_vertices // 4:
        values, vectors = eigh(operator.toarray(), subset_by_index=[0, n_pairs - 1])
        values[: zero_modes.shape[1]], vectors[:, : zero_modes.shape[1]] = 0, zero_modes
    else:
        values, vectors = _shift_invert(operator, zero_modes, n_pairs)
    _check(operator, values, vectors)
    return values, _with_fixed_signs(vectors / root[:, None])


def _zero_modes(stiffness: csc_matrix, root: FloatArray) -> FloatArray:
    """(n, c) orthonormal null space: one constant for each component of the mesh."""
    count, label = connected_components(csr_matrix(stiffness), directed=False)
    modes = np.zeros((len(root), count))
    modes[np.arange(len(root)), label] = root
    return np.asarray(modes / np.linalg.norm(modes, axis=0))


def _shift_invert(operator: csc_matrix, zero_modes: FloatArray, n_pairs: int) -> tuple[FloatArray, FloatArray]:
    """Lanczos on (A + SHIFT)⁻¹, with the known null space taken out and missed pairs looked for."""
    factor = _factor(operator, -SHIFT)
    wanted = n_pairs - zero_modes.shape[1]
    # One pair more, so that the inertia count has a gap to stand in behind the last pair that is handed out.
    found = _lanczos(factor, zero_modes, wanted + 1)
    values, vectors = _rayleigh_ritz(operator, np.hstack([zero_modes, found]))
    for _ in range(MAX_REPAIRS):
        place = _widest_gap(values, n_pairs)
        below = _eigenvalues_below(operator, (values[place - 1] + values[place]) / 2)
        missed = below - place
        if missed <= 0:
            break
        # Lanczos from one vector sees one of several equal eigenvalues: look again beside what was found.
        more = _lanczos(factor, vectors, missed + 1)
        values, vectors = _rayleigh_ritz(operator, np.hstack([vectors, more]))
    else:
        raise SpectrumError(f"{missed} of {n_pairs} eigenpairs were not found")
    for _ in range(MAX_REPAIRS):
        if _residual(operator, values, vectors) <= TOLERANCE:
            break
        # Thin triangles cost Lanczos digits, which inverse iteration of the whole block brings back.
        values, vectors = _rayleigh_ritz(operator, np.asarray(factor.solve(vectors)))
    values, vectors = values[:n_pairs], vectors[:, :n_pairs]
    values[: zero_modes.shape[1]], vectors[:, : zero_modes.shape[1]] = 0, zero_modes
    return values, vectors


def _factor(operator: csc_matrix, shift: float) -> SuperLU:
    """LU factors of A − shift, with pivots from the diagonal so that the symmetry is used and shows."""
    shifted = csc_matrix(operator - shift * diags(np.ones(operator.shape[0])))
    return splu(shifted, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})


def _lanczos(factor: SuperLU, known: FloatArray, count: int) -> FloatArray:
    """(n, count) eigenvectors of the lowest eigenvalues, orthogonal to the `known` vectors."""

    def apply(x: FloatArray) -> FloatArray:
        y = factor.solve(x - known @ (known.T @ x))
        return np.asarray(y - known @ (known.T @ y))

    n = len(known)
    start = apply(np.random.default_rng(0).standard_normal(n))
    count = min(count, n - known.shape[1] - 1)
    inverse = LinearOperator((n, n), matvec=apply, dtype=np.float64)
    return np.asarray(eigsh(inverse, k=count, which="LM", v0=start)[1])


def _rayleigh_ritz(operator: csc_matrix, basis: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Best eigenpairs of A within the span of a basis."""
    orthonormal = np.linalg.qr(basis)[0]
    values, rotation = np.linalg.eigh(orthonormal.T @ (operator @ orthonormal))
    return values, orthonormal @ rotation


def _widest_gap(values: FloatArray, n_pairs: int) -> int:
    """Index behind which the values jump most, at or after the last pair that is handed out.

    A count between two almost equal eigenvalues would depend on rounding.
    """
    return n_pairs + int(np.argmax(np.diff(values[n_pairs - 1 :])))


def _eigenvalues_below(operator: csc_matrix, shift: float) -> int:
    """Number of eigenvalues under a shift: Sylvester's law of inertia, read from the signs of the pivots."""
    factor: IntArray = _factor(operator, shift).U.diagonal()
    return int((factor < 0).sum())


def _residual(operator: csc_matrix, values: FloatArray, vectors: FloatArray) -> float:
    """Largest relative residual ‖A ψ − λ ψ‖ / λ, beyond what rounding explains."""
    # Near zero a residual cannot be relative to the value itself: the first non-zero one sets the scale.
    above = values[values > 1.0]
    scale = np.maximum(values, above.min() if above.size else 1.0)
    rounding = ROUNDING * abs(operator).sum(axis=0).max()
    residuals = np.linalg.norm(operator @ vectors - vectors * values, axis=0)
    return float((np.maximum(residuals - rounding, 0) / scale).max())


def _check(operator: csc_matrix, values: FloatArray, vectors: FloatArray) -> None:
    """Raise SpectrumError unless the pairs are pairs and the vectors orthonormal."""
    residual = _residual(operator, values, vectors)
    departure = np.abs(vectors.T @ vectors - np.eye(len(values))).max()
    if not max(residual, departure) <= TOLERANCE:
        raise SpectrumError(
            f"the eigenpairs are not accurate enough: relative residual {residual:.1e}, departure from "
            f"orthonormality {departure:.1e}, allowed {TOLERANCE:.0e}"
        )


def _with_fixed_signs(functions: FloatArray) -> FloatArray:
    """Flip each function so that its largest entry is positive: the same result on every machine."""
    largest = np.argmax(np.abs(functions), axis=0)
    signs = np.where(functions[largest, np.arange(functions.shape[1])] < 0, -1.0, 1.0)
    return functions * signs
