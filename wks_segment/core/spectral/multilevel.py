"""The fast eigensolver: a coarse solve, lifted to the surface level by level and corrected there.

A correction is one step of inverse iteration, x ← x − ω (S + shift M)⁻¹ (S x − λ M x), with the ω from 1 to 2 that
lowers the Rayleigh quotient most. It needs few digits, so that single precision is enough, and its size tells how far
off a function was. Functions come out a panel of columns at a time: those of a large surface are never there all at
once.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator

import numpy as np
from scipy.linalg import LinAlgError, eigh
from scipy.sparse import csr_matrix

from ..mesh.triangle_mesh import FloatArray
from .coarsening import Level, coarse_eigenpairs
from .multifrontal import NestedDissectionFactor, SingularError

CELLS_PER_PAIR, MORE_CELLS_PER_PAIR = 4.0, 5.0
"""Size of the coarse space, which is solved densely. A second correction costs more than more cells from `MANY` on."""
MANY = 40_000
SPARE_PAIRS, LEAST_SPARE = 0.1, 8
"""Pairs carried along beyond those asked for, as a fraction of them and as a number: a correction may change their
order."""
SHIFT = 0.5
"""Shift of the inverse for each pair asked for; a small shift would cost single precision its digits."""
LARGEST_CHANGE, LARGEST_CHANGE_LATER = 0.07, 0.03
"""Relative change of a function up to which a correction was the last one: what is left is a small part of it, and the
signature within 0.2 to 0.6 % of the exact one. The latter where an earlier correction was larger."""
LEAST_DIRECTION = 1e-5
"""Squared size of a direction among the changes, relative to the largest, below which it is rounding."""
WORTH_A_DIRECTION = 0.01
"""Relative change of a function from which it widens the subspace."""
MAX_CORRECTIONS = 4
"""Corrections before the coarse space is refined."""
LEAST_VALUE = 1e-6
"""A first value below this fraction of the last one is rounding, or needs more digits than there are."""

LARGE = 180_000
"""Vertices from which a level of cells comes between the coarse space and the surface, so many that its functions need
a correction on the surface only seldom."""
MIDDLE_CELLS_PER_PAIR = 80
LARGEST_CHANGE_OF_LIFTED = 0.03
"""Functions of the cells that a correction on the surface would change by no more stay as they are."""
PROBES = 4
"""Functions for which that change is estimated, evenly chosen, the last one among them."""
PROBE_STEPS = 8
"""Conjugate gradient steps of that estimate."""
DAMPING = 0.5
"""Share of Jacobi's step in the preconditioner."""

PANEL = 7_500_000
"""Numbers in one panel of functions, 30 MB: wide enough for the solve, and under the 32 MB above which memory that is
given back goes to the system, and each new array costs a page fault every 4 KB."""
PRODUCT_COLUMNS = 64
"""Columns in one sparse product: what a row and its neighbors need should stay in the cache."""
CHUNK = 1024
"""Rows in one step of what is done entry by entry."""


class SpectrumWarning(UserWarning):
    """Eigenpairs came out otherwise than they were asked for."""


class NotConvergedError(ArithmeticError):
    """Corrections stay large, or single precision does not suffice."""


def hierarchical_eigenpairs(
    level: Level, count: int, n_zero: int, tick: Callable[[float], None]
) -> tuple[FloatArray, Iterator[tuple[slice, FloatArray]]]:
    """The lowest non-zero eigenvalues of S x = λ M x, and panels of their functions.

    Parameters
    ----------
    level : Level
        The surface, with n vertices.
    count : int
        k, how many pairs.
    n_zero : int
        Number of components of the surface, each with a zero mode.
    tick : callable
        Called with the share of the work that is done, 0 to 1.

    Returns
    -------
    (k,) array, and an iterator over pairs of columns and their (n, number of columns) array of float32, M-normalized.

    Raises
    ------
    NotConvergedError
        If it cannot be done this way.
    """
    try:
        if len(level.areas) <= LARGE:
            values, vectors = _solve(level, _Correction(level, count), count, n_zero, tick)
            return values, ((columns, vectors[:, columns]) for columns in panels(*vectors.shape))
        prolongation, cells = level.coarsened(MIDDLE_CELLS_PER_PAIR * count + n_zero)
        tick(0.3)
        on_cells = _Correction(cells, count)
        values, weights = _solve(cells, on_cells, count, n_zero, lambda share: tick(0.3 + 0.2 * share))
        change = _change_ahead(level, prolongation, on_cells, values, weights)
        if not change <= LARGEST_CHANGE:
            raise NotConvergedError("the cells do not carry the functions of the surface")
        correction = _Correction(level, count) if change > LARGEST_CHANGE_OF_LIFTED else None
        tick(0.6)
        return values, _lifted(prolongation, values, weights, correction, lambda share: tick(0.6 + 0.4 * share))
    except (SingularError, LinAlgError) as error:
        raise NotConvergedError(f"single precision does not suffice: {error}") from error


def _solve(
    level: Level, correction: _Correction, count: int, n_zero: int, tick: Callable[[float], None]
) -> tuple[FloatArray, FloatArray]:
    """Pairs from a coarse space, corrected on the level until corrections are small."""
    n_cells = round((MORE_CELLS_PER_PAIR if len(level.areas) > MANY else CELLS_PER_PAIR) * count)
    n_cells = max(n_cells, 2 * (count + n_zero))
    while 2 * n_cells < len(level.areas):
        prolongation, cells = level.coarsened(n_cells, wide=True)
        tick(0.2)
        values, weights = coarse_eigenpairs(cells, n_zero, round((1 + SPARE_PAIRS) * count) + LEAST_SPARE)
        if len(values) < count:
            n_cells *= 2
            continue
        vectors = times(prolongation, weights)
        tick(0.5)
        for step in range(MAX_CORRECTIONS):
            changes = np.empty(len(values))
            for columns in panels(len(vectors), len(values)):
                panel = np.ascontiguousarray(vectors[:, columns])
                values[columns], changes[columns] = correction(values[columns], panel)
                vectors[:, columns] = panel
                tick(0.5 + 0.4 * columns.stop / len(values))
            if not changes[:count].max() <= (LARGEST_CHANGE_LATER if step else LARGEST_CHANGE):
                values, vectors = _enlarged(correction, vectors)
                continue
            # The residual of a Ritz vector is orthogonal to all others, and so nearly is its correction.
            order = np.argsort(values, kind="stable")[:count]
            if values[order[0]] > LEAST_VALUE * values[order[-1]]:
                return values[order], vectors[:, order]
            break
        n_cells *= 2
    raise NotConvergedError("corrections stay large")


class _Correction:
    """Corrects approximate eigenpairs on a level; see the top of the module."""

    def __init__(self, level: Level, count: int) -> None:
        self.level = level
        self.shift = SHIFT * count
        shifted = csr_matrix(level.stiffness + np.float32(self.shift) * level.mass)
        self.factor = NestedDissectionFactor(shifted, level.positions)
        if self.factor.n_negative:
            raise NotConvergedError("rounding makes the shifted operator indefinite")

    def __call__(self, values: FloatArray, vectors: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Correct a panel of vectors in place. Returns their Rayleigh quotients and their relative changes."""
        change, residual, weighted = self.change(values, vectors)
        # x is a vector, e its change, r its residual S x − λ M x. (S + shift M) e = r spares the product S e.
        xx, xe = _dots(vectors, weighted), _dots(change, weighted)
        xr, er = _dots(vectors, residual), _dots(change, residual)
        ee = _dots(change, times(self.level.mass, change))
        # The Rayleigh quotient of x − ω e is stationary where a ω² + b ω + c = 0.
        above = values + self.shift
        a = above * xe * ee + er * (ee - xe)
        b = er * xx - above * ee * xx - xr * ee
        c = xr * xe - er * xx
        root = b + np.sqrt(np.maximum(b**2 - 4 * a * c, 0))
        step = np.clip(-2 * c / np.where(root > 0, root, np.inf), 1, 2)
        squares = xx - 2 * step * xe + step**2 * ee
        energies = values * xx + xr - 2 * step * (values * xe + er) + step**2 * (er - self.shift * ee)
        scale = (1 / np.sqrt(squares)).astype(np.float32)
        of_step = step.astype(np.float32) * scale
        for rows in _chunks(vectors):
            vectors[rows] *= scale
            vectors[rows] -= change[rows] * of_step
        return energies / squares, np.sqrt(ee / xx)

    def change(self, values: FloatArray, vectors: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(S + shift M)⁻¹ r, the residual r = S x − λ M x, and M x."""
        weighted = times(self.level.mass, vectors)
        residual = times(self.level.stiffness, vectors)
        of_values = values.astype(np.float32)
        for rows in _chunks(vectors):
            residual[rows] -= weighted[rows] * of_values
        return self.factor.solve(residual), residual, weighted


def _enlarged(correction: _Correction, vectors: FloatArray) -> tuple[FloatArray, FloatArray]:
    """As many eigenpairs, the best within the span of vectors and their changes, where these are large.

    Finds functions that the coarse space hardly held, as those of thin parts (Rayleigh and Ritz).
    """
    level = correction.level
    zero_modes = level.zero_modes()
    values, vectors = _rayleigh_ritz(level, _without(zero_modes, level, vectors), vectors.shape[1])
    large: list[FloatArray] = []
    for columns in panels(*vectors.shape):
        changes = correction.change(values[columns], np.ascontiguousarray(vectors[:, columns]))[0]
        squares = _dots(changes, times(level.mass, changes))
        large.append(changes[:, squares > WORTH_A_DIRECTION**2])
    changes = np.hstack(large)
    if not changes.shape[1]:
        return values, vectors
    changes = _without(vectors, level, _without(zero_modes, level, changes))
    squares, directions = np.linalg.eigh((changes.T @ times(level.mass, changes)).astype(np.float64))
    kept = squares > LEAST_DIRECTION * squares[-1]
    changes = changes @ (directions[:, kept] / np.sqrt(squares[kept])).astype(np.float32)
    return _rayleigh_ritz(level, np.hstack([vectors, changes]), vectors.shape[1])


def _rayleigh_ritz(level: Level, basis: FloatArray, count: int) -> tuple[FloatArray, FloatArray]:
    """The lowest eigenpairs within the span of a basis."""
    energy = (basis.T @ times(level.stiffness, basis)).astype(np.float64)
    gram = (basis.T @ times(level.mass, basis)).astype(np.float64)
    if not (np.isfinite(energy).all() and np.isfinite(gram).all()):
        raise NotConvergedError("corrections are not finite")
    values, rotation = eigh((energy + energy.T) / 2, gram, subset_by_index=[0, count - 1])
    return values, basis @ rotation.astype(np.float32)


def _without(known: FloatArray, level: Level, vectors: FloatArray) -> FloatArray:
    """Vectors less their part in the span of known, M-orthonormal ones."""
    return np.asarray(vectors - known @ (times(level.mass, known).T @ vectors))


def _lifted(
    prolongation: csr_matrix,
    values: FloatArray,
    weights: FloatArray,
    correction: _Correction | None,
    tick: Callable[[float], None],
) -> Iterator[tuple[slice, FloatArray]]:
    """Panels of functions from their values at cells, corrected on the surface where a correction is given.

    What is M-normalized on the cells is so on the surface: Galerkin's mass matrix is that of the lifted functions. The
    values stay those of the cells, which are known before the functions.
    """
    for columns in panels(prolongation.shape[0], len(values)):
        vectors = prolongation @ np.ascontiguousarray(weights[:, columns])
        if correction:
            changes = correction(values[columns], vectors)[1]
            # No second one: each also makes more of whatever lower functions are in there, which are not at hand.
            if not changes.max() <= LARGEST_CHANGE:
                warnings.warn(
                    f"eigenfunctions {columns.start} to {columns.stop} of this very large mesh may be off by some per "
                    "cent: compare with a decimated copy, or use the exact solver",
                    SpectrumWarning,
                    stacklevel=2,
                )
        yield columns, vectors
        tick(columns.stop / len(values))


def _change_ahead(
    level: Level, prolongation: csr_matrix, on_cells: _Correction, values: FloatArray, weights: FloatArray
) -> float:
    """Relative change that a correction on the surface would bring, estimated for a few functions without a factor.

    Conjugate gradients, preconditioned by Jacobi's step for what varies from vertex to vertex and by the inverse on
    the cells for the rest (Bramble, Pasciak and Xu, 1990).
    """
    chosen = np.linspace(0, len(values) - 1, PROBES).round().astype(np.int64)
    vectors = prolongation @ np.ascontiguousarray(weights[:, chosen])
    mass = level.mass @ vectors
    shifted = csr_matrix(level.stiffness + np.float32(on_cells.shift) * level.mass)
    jacobi = (DAMPING / shifted.diagonal()).astype(np.float32)[:, None]
    residual = level.stiffness @ vectors - mass * values[chosen].astype(np.float32)
    change, direction, before = np.zeros_like(vectors), np.zeros_like(vectors), np.ones(len(chosen))
    for _ in range(PROBE_STEPS):
        conditioned = jacobi * residual + prolongation @ on_cells.factor.solve(prolongation.T @ residual)
        now = _dots(residual, conditioned)
        direction = conditioned + direction * (now / before).astype(np.float32)
        image = shifted @ direction
        step = (now / _dots(direction, image)).astype(np.float32)
        change += direction * step
        residual -= image * step
        before = now
    return float(np.sqrt(_dots(change, level.mass @ change) / _dots(vectors, mass)).max())


def panels(n_rows: int, n_columns: int) -> Iterator[slice]:
    """Columns that are worked on at once, in panels of nearly one width."""
    width = max(PANEL // n_rows // PRODUCT_COLUMNS, 1) * PRODUCT_COLUMNS
    count = -(-n_columns // width)
    for i in range(count):
        yield slice(i * n_columns // count, (i + 1) * n_columns // count)


def times(matrix: csr_matrix, vectors: FloatArray) -> FloatArray:
    """matrix @ vectors for a sparse matrix, in blocks of columns that suit the cache."""
    if matrix.nnz == matrix.shape[0] and (diagonal := matrix.diagonal()).all():  # as masses of vertices are
        return np.asarray(vectors * diagonal[:, None])
    if vectors.shape[1] <= PRODUCT_COLUMNS:
        return np.asarray(matrix @ np.ascontiguousarray(vectors))
    result: FloatArray = np.empty((matrix.shape[0], vectors.shape[1]), dtype=np.float32)
    for start in range(0, vectors.shape[1], PRODUCT_COLUMNS):
        columns = slice(start, start + PRODUCT_COLUMNS)
        result[:, columns] = matrix @ np.ascontiguousarray(vectors[:, columns])
    return result


def _chunks(array: FloatArray) -> Iterator[slice]:
    """Rows that stay in the cache from one step to the next."""
    for start in range(0, len(array), CHUNK):
        yield slice(start, start + CHUNK)


def _dots(a: FloatArray, b: FloatArray) -> FloatArray:
    """Product of each column of one array with the same column of another.

    In single precision within a chunk of rows, in double precision from there on.
    """
    total = np.zeros(a.shape[1])
    for rows in _chunks(a):
        total += np.einsum("ij,ij->j", a[rows], b[rows])
    return total
