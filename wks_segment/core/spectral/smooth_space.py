"""First approximation of the eigenpairs, in a space of functions that are smooth on the surface.

The space holds (S + shift M)⁻¹ M f for functions f over a few cells for each pair. The functions f are linear in space,
and poor where the surface folds within a cell: at rims of sheets, fingers, ears and lips. The inverse makes them smooth
along the surface itself, so that one or two corrections suffice there too.

The space is never computed. Of T(σ) = (M f)ᵀ (S + σ M)⁻¹ (M f), which needs half of a sparse solve, the values at two
shifts suffice, because (S + σ M)⁻¹ − (S + τ M)⁻¹ = (τ − σ) (S + τ M)⁻¹ M (S + σ M)⁻¹: T(τ) is the energy, and this
difference the mass, of the space at σ tested with that at τ (Petrov and Galerkin). Galerkin's own matrices, from dense
solutions for all cells, are no more accurate and take several times as long.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import LinAlgError, cholesky
from scipy.sparse import csr_matrix

from ..mesh.triangle_mesh import FloatArray
from ..progress import Progress
from .coarsening import Level
from .dense_eigen import lowest_eigenpairs, solve_lower_triangular
from .multifrontal import Dissection, MultifrontalFactor, SingularError, nested_dissection

SHIFT_RATIO = 5.0
"""Larger shift over the smaller one: 2 to 20 are as accurate, and a larger difference has more digits."""
RAISED_DIAGONAL = 1e-6
"""Relative increase of the diagonal, so that cells whose functions hardly differ leave the matrix positive definite."""


class ShiftedOperator:
    """S + shift M on a level, factorized in the precision of the level.

    Parameters
    ----------
    level : Level
    shift : float
    dissection : optional
        That of another shift.

    Raises
    ------
    SingularError
        If rounding makes it indefinite.
    """

    def __init__(self, level: Level, shift: float, dissection: Dissection | None = None) -> None:
        self.level, self.shift, self.dtype = level, shift, level.stiffness.dtype.type
        matrix = csr_matrix(level.stiffness + self.dtype(shift) * level.mass)
        self.dissection = dissection or nested_dissection(matrix, level.positions)
        self.factor = MultifrontalFactor(matrix, level.positions, self.dtype, self.dissection)
        if self.factor.n_negative:
            raise SingularError("rounding makes the shifted operator indefinite")


def smooth_eigenpairs(
    operator: ShiftedOperator, n_cells: int, count: int, progress: Progress
) -> tuple[FloatArray, csr_matrix, FloatArray]:
    """Approximations of the lowest non-zero eigenpairs, at most `count`.

    Returns
    -------
    values : (k,) array, rising
    sources : (n, number of cells) sparse matrix
    weights : (number of cells, k) array
        The eigenfunctions are (S + shift M)⁻¹ sources @ weights, M-normalized.

    Raises
    ------
    scipy.linalg.LinAlgError
        If single precision does not suffice.
    SingularError
    """
    level, shift, other = operator.level, operator.shift, SHIFT_RATIO * operator.shift
    functions = level.functions_over_cells(n_cells)
    sources = csr_matrix(level.mass @ functions)
    progress(0.09)
    energy = ShiftedOperator(level, other, operator.dissection).factor.compressed(sources)
    progress(0.42)
    mass = (operator.factor.compressed(sources) - energy) / operator.dtype(other - shift)
    progress(0.59)  # before the dense eigenproblem, which cannot report
    energy[np.diag_indices_from(energy)] *= 1 + RAISED_DIAGONAL
    if not (np.isfinite(energy).all() and np.isfinite(mass).all()):
        raise LinAlgError("the coarse space has entries that are not finite")
    # mass y = ν energy y, with the largest ν = 1 / (λ + shift)
    factor = cholesky(energy, lower=True)
    reduced = solve_lower_triangular(factor, solve_lower_triangular(factor, mass).T)
    islands = factor.T @ (functions.T @ level.zero_modes() != 0).astype(operator.dtype)
    islands /= np.linalg.norm(islands, axis=0)
    reduced -= islands @ (islands.T / operator.dtype(shift))
    count = min(count, len(reduced) - islands.shape[1])
    negative_inverses, weights = lowest_eigenpairs(-(reduced + reduced.T) / 2, count)
    inverses = -negative_inverses.astype(np.float64)
    if not inverses[-1] > 0:
        raise LinAlgError("rounding hides eigenvalues in the coarse space")
    values = np.maximum(1 / inverses - shift, 0)
    # A function of one shift is that of the other one times (λ + other) / (λ + shift).
    scale = np.sqrt((values + shift) / (values + other) / inverses)
    weights = solve_lower_triangular(factor, weights * scale.astype(operator.dtype), transposed=True)
    return values, sources, np.ascontiguousarray(weights, operator.dtype)
