"""Fast eigensolver: a coarse solve, carried to the surface level by level and corrected there in single precision.

A correction is one step of inverse iteration, x ← x − ω (S + shift M)⁻¹ (S x − λ M x), with the ω from 1 to 2 that
lowers the Rayleigh quotient most. It needs few digits, so that single precision suffices, and its size estimates the
error of a function. Functions are handed out in panels of columns: those of a large surface are never all in memory.

Ours because no library for all platforms has anything comparable: 300 pairs on 100,000 vertices take SciPy's `eigsh`
71 s and this solver 3.9 s, at an error of the signature of 0.2 to 0.4 % (docs/speed.md), which is less than remeshing
changes the exact signature (0.7 to 2.3 %). LOBPCG with algebraic multigrid did not finish in 150 s.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator

import numpy as np
from scipy.linalg import LinAlgError
from scipy.sparse import csr_matrix

from ..mesh.triangle_mesh import FloatArray
from ..message import Message
from ..progress import Progress
from .coarsening import Level, coarse_eigenpairs
from .multifrontal import MultifrontalFactor, SingularError
from .subspace import block_product, rayleigh_ritz

COARSE_CELLS_PER_PAIR, COARSE_CELLS_PER_PAIR_ABOVE = 4.0, 5.0
"""Cells of the coarse space, which is solved densely, for each pair: up to `MORE_CELLS_ABOVE` vertices, and above."""
MORE_CELLS_ABOVE = 40_000
"""Number of vertices above which a second correction costs more than additional cells."""
SPARE_PAIRS, LEAST_SPARE = 0.1, 8
"""Additional pairs, as a fraction of the pairs that are asked for and as a number: a correction may change the order of
pairs."""
SHIFT_PER_PAIR = 0.5
"""Shift of the inverse for each pair that is asked for; a small shift would cost single precision its digits."""
LARGEST_CHANGE, LARGEST_LATER_CHANGE = 0.07, 0.03
"""Largest relative change of a function by its last correction: the remaining error is a small part of it, and the
signature is within 0.2 to 0.6 % of the exact one. The second value holds after a correction that was larger."""
LEAST_DIRECTION = 1e-5
"""Squared size of a direction among the changes, relative to the largest, below which it is rounding."""
LEAST_USEFUL_CHANGE = 0.01
"""Least relative change of a function for which its change is added to the subspace."""
MAX_CORRECTIONS = 4
"""Most corrections before the coarse space is refined."""
LEAST_VALUE = 1e-6
"""Fraction of the last eigenvalue below which the first one is rounding, or needs more digits than there are."""

FACTORED, PREPARED, COARSE_SOLVED, CORRECTED, CERTAIN = 0.05, 0.14, 0.5, 0.53, 0.9
"""Shares of the time of a solve after which the operator is factorized, the coarse space is made and solved, its
functions are corrected, and the pairs are certain. In between, rounds enlarge the space and correct again. The dense
coarse problem cannot report: it takes from 0.1 to 0.4 of the time if there are rounds, and from 0.2 to 0.9 if there are
none, which shows only later."""
LEFT_BY_ROUND, LEFT_BY_SLOW_ROUND, SLOW_CHANGE = 0.15, 0.45, 0.4
"""Share of the time until the pairs are certain that a round leaves. Mostly one round suffices, and two to three if the
first correction changes a hundredth of the functions by more than the last number: so on 10 of 11 characters."""
ENLARGED = 0.95
"""Share of the time of a round after which the space is enlarged; the correction is quick."""
CELL_LEVEL_ABOVE = 180_000
"""Number of vertices above which a level of cells is inserted between the coarse space and the surface. It has so many
cells that its functions seldom need a correction on the surface."""
MIDDLE_CELLS_PER_PAIR = 80
"""Cells of that level for each pair."""
LARGEST_UNCORRECTED_CHANGE = 0.03
"""Functions of the cells stay uncorrected if a correction on the surface would change them by no more than this."""
PROBES = 4
"""Number of functions for which that change is estimated, evenly spaced, the last one included."""
PROBE_STEPS = 8
"""Conjugate gradient steps of that estimate."""
JACOBI_DAMPING = 0.5
"""Damping of Jacobi's step in the preconditioner of that estimate."""

PANEL = 7_500_000
"""Numbers in one panel of functions, 30 MB: wide enough for efficient solves, and below the 32 MB above which freed
memory goes back to the system, so that each new array would cost a page fault every 4 KB."""
FAST_COLUMNS = 64
"""Columns in one sparse product: a row and its neighbors should fit the cache."""
CHUNK = 1024
"""Rows in one step of entry-wise operations, so that they fit the cache."""


class SpectrumWarning(UserWarning):
    """The eigenpairs differ from those that were asked for: there are fewer, or they are less accurate."""


class NotConvergedError(ArithmeticError):
    """Corrections stay large, or single precision does not suffice."""


def multilevel_eigenpairs(
    level: Level, count: int, n_zero: int, progress: Progress
) -> tuple[FloatArray, Iterator[tuple[slice, FloatArray]]]:
    """The lowest non-zero eigenvalues of S x = λ M x, and their functions in panels.

    Parameters
    ----------
    level : Level
        The surface, with n vertices.
    count : int
        k, the number of pairs.
    n_zero : int
        Number of islands of the surface, each with a zero mode.
    progress : Progress

    Returns
    -------
    (k,) array, and an iterator over panels: a slice of columns and an (n, number of columns) array of float32,
    M-normalized.

    Raises
    ------
    NotConvergedError
        If corrections stay large, or single precision does not suffice.
    """
    try:
        if len(level.areas) <= CELL_LEVEL_ABOVE:
            values, vectors = _solve(level, _Correction(level, count), count, n_zero, progress)
            return values, ((columns, vectors[:, columns]) for columns in panels(*vectors.shape))
        prolongation, cells = level.coarsened(MIDDLE_CELLS_PER_PAIR * count + n_zero)
        progress(0.3)
        on_cells = _Correction(cells, count)
        values, weights = _solve(cells, on_cells, count, n_zero, progress.part(0.3, 0.5))
        change = _expected_change(level, prolongation, on_cells, values, weights)
        if not change <= LARGEST_CHANGE:
            raise NotConvergedError("the cells do not represent the functions of the surface")
        correction = _Correction(level, count) if change > LARGEST_UNCORRECTED_CHANGE else None
        progress(0.6)
        return values, _prolonged(prolongation, values, weights, correction, progress.part(0.6, 1.0))
    except (SingularError, LinAlgError) as error:
        raise NotConvergedError(f"single precision does not suffice: {error}") from error


def _solve(
    level: Level, correction: _Correction, count: int, n_zero: int, progress: Progress
) -> tuple[FloatArray, FloatArray]:
    """Eigenpairs from a coarse space, corrected on the level until corrections are small."""
    per_pair = COARSE_CELLS_PER_PAIR_ABOVE if len(level.areas) > MORE_CELLS_ABOVE else COARSE_CELLS_PER_PAIR
    n_cells = max(round(per_pair * count), 2 * (count + n_zero))
    progress(FACTORED)
    while 2 * n_cells < len(level.areas):
        prolongation, cells = level.coarsened(n_cells, wide=True)
        progress(PREPARED)
        values, weights = coarse_eigenpairs(cells, n_zero, round((1 + SPARE_PAIRS) * count) + LEAST_SPARE)
        if len(values) < count:
            n_cells *= 2
            continue
        vectors = block_product(prolongation, weights, FAST_COLUMNS)
        progress(COARSE_SOLVED)
        done, end = COARSE_SOLVED, CORRECTED
        for step in range(MAX_CORRECTIONS):
            changes = np.empty(len(values))
            for columns in panels(len(vectors), len(values)):
                panel = np.ascontiguousarray(vectors[:, columns])
                values[columns], changes[columns] = correction(values[columns], panel)
                vectors[:, columns] = panel
                progress(done + (end - done) * columns.stop / len(values))
            if not changes[:count].max() <= (LARGEST_LATER_CHANGE if step else LARGEST_CHANGE):
                if step == 0:
                    left = LEFT_BY_SLOW_ROUND if np.quantile(changes, 0.99) > SLOW_CHANGE else LEFT_BY_ROUND
                begun, end = end, CERTAIN - left * (CERTAIN - end)
                done = begun + ENLARGED * (end - begun)
                values, vectors = _enlarged(correction, vectors, progress.part(begun, done))
                continue
            # The residual of a Ritz vector is orthogonal to all others, and so nearly is its correction.
            order = np.argsort(values, kind="stable")[:count]
            if values[order[0]] > LEAST_VALUE * values[order[-1]]:
                progress(CERTAIN)
                return values[order], vectors[:, order]
            break
        n_cells *= 2
        progress = progress.part(CERTAIN, 1.0)
    raise NotConvergedError("corrections stay large")


class _Correction:
    """Correction of approximate eigenpairs on a level; see the docstring of the module."""

    def __init__(self, level: Level, count: int) -> None:
        self.level = level
        self.shift = SHIFT_PER_PAIR * count
        shifted = csr_matrix(level.stiffness + np.float32(self.shift) * level.mass)
        self.factor = MultifrontalFactor(shifted, level.positions)
        if self.factor.n_negative:
            raise NotConvergedError("rounding makes the shifted operator indefinite")

    def __call__(self, values: FloatArray, vectors: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Correct a panel of vectors in place; returns their Rayleigh quotients and their relative changes."""
        change, residual, weighted = self.change(values, vectors)
        # x is a vector, e its change, r its residual S x − λ M x. The product S e follows from (S + shift M) e = r.
        xx, xe = _dots(vectors, weighted), _dots(change, weighted)
        xr, er = _dots(vectors, residual), _dots(change, residual)
        ee = _dots(change, _weighted(self.level, change))
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
        scaled_step = step.astype(np.float32) * scale
        for rows in _chunks(vectors):
            vectors[rows] *= scale
            vectors[rows] -= change[rows] * scaled_step
        return energies / squares, np.sqrt(ee / xx)

    def change(self, values: FloatArray, vectors: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(S + shift M)⁻¹ r, the residual r = S x − λ M x, and M x, for a panel of vectors x."""
        weighted = _weighted(self.level, vectors)
        residual = _stiff(self.level, vectors)
        single = values.astype(np.float32)
        for rows in _chunks(vectors):
            residual[rows] -= weighted[rows] * single
        return self.factor.solve(residual), residual, weighted


def _enlarged(correction: _Correction, vectors: FloatArray, progress: Progress) -> tuple[FloatArray, FloatArray]:
    """The same number of eigenpairs, best within the span of the vectors and their large changes.

    This finds functions that are hardly in the coarse space, as those of thin parts of the shape.
    """
    level = correction.level
    zero_modes = level.zero_modes()
    values, vectors = _lowest_in_span(
        level, _without(zero_modes, level, vectors), vectors.shape[1], progress.part(0.0, 0.3)
    )
    large: list[FloatArray] = []
    for columns in panels(*vectors.shape):
        changes = correction.change(values[columns], np.ascontiguousarray(vectors[:, columns]))[0]
        squares = _dots(changes, _weighted(level, changes))
        large.append(changes[:, squares > LEAST_USEFUL_CHANGE**2])
        progress(0.3 + 0.2 * columns.stop / len(values))
    changes = np.hstack(large)
    if not changes.shape[1]:
        return values, vectors
    changes = _without(vectors, level, _without(zero_modes, level, changes))
    squares, directions = np.linalg.eigh((changes.T @ _weighted(level, changes)).astype(np.float64))
    kept = squares > LEAST_DIRECTION * squares[-1]
    changes = changes @ (directions[:, kept] / np.sqrt(squares[kept])).astype(np.float32)
    return _lowest_in_span(level, np.hstack([vectors, changes]), vectors.shape[1], progress.part(0.5, 1.0))


def _lowest_in_span(level: Level, basis: FloatArray, count: int, progress: Progress) -> tuple[FloatArray, FloatArray]:
    """The lowest eigenpairs within the span of a basis."""
    energy = basis.T @ _stiff(level, basis)
    progress(0.3)
    squares = basis.T @ _weighted(level, basis)
    progress(0.8)  # before the dense eigenproblem, which takes half of the time and cannot report
    return rayleigh_ritz(basis, energy, squares, count)


def _without(known: FloatArray, level: Level, vectors: FloatArray) -> FloatArray:
    """Vectors without their part in the span of known M-orthonormal vectors."""
    return np.asarray(vectors - known @ (_weighted(level, known).T @ vectors))


def _prolonged(
    prolongation: csr_matrix,
    values: FloatArray,
    weights: FloatArray,
    correction: _Correction | None,
    progress: Progress,
) -> Iterator[tuple[slice, FloatArray]]:
    """Panels of functions from their values at cells, corrected on the surface if a correction is given.

    Functions that are M-normalized on the cells are so on the surface: Galerkin's mass matrix is that of the prolonged
    functions. The eigenvalues remain those of the cells, which are known before the functions.
    """
    for columns in panels(prolongation.shape[0], len(values)):
        vectors = prolongation @ np.ascontiguousarray(weights[:, columns])
        if correction:
            changes = correction(values[columns], vectors)[1]
            # No second correction: each also amplifies parts along lower functions, which are in other panels.
            if not changes.max() <= LARGEST_CHANGE:
                text = Message(
                    "eigenfunctions {first} to {last} of this very large mesh may be off by a few percent: compare "
                    "with a decimated copy, or use the exact solver",
                    first=columns.start,
                    last=columns.stop,
                )
                warnings.warn(text, SpectrumWarning, stacklevel=2)
        yield columns, vectors
        progress(columns.stop / len(values))


def _expected_change(
    level: Level, prolongation: csr_matrix, on_cells: _Correction, values: FloatArray, weights: FloatArray
) -> float:
    """Largest relative change that a correction on the surface would make, estimated without a factor.

    By conjugate gradients for a few functions, preconditioned by Jacobi's step for variation from vertex to vertex and
    by the inverse on the cells for the rest (Bramble, Pasciak and Xu, 1990).
    """
    chosen = np.linspace(0, len(values) - 1, PROBES).round().astype(np.int64)
    vectors = prolongation @ np.ascontiguousarray(weights[:, chosen])
    mass = level.mass @ vectors
    shifted = csr_matrix(level.stiffness + np.float32(on_cells.shift) * level.mass)
    jacobi = (JACOBI_DAMPING / shifted.diagonal()).astype(np.float32)[:, None]
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
    """Columns of each panel; all panels have about the same width."""
    width = max(PANEL // n_rows // FAST_COLUMNS, 1) * FAST_COLUMNS
    count = -(-n_columns // width)
    for i in range(count):
        yield slice(i * n_columns // count, (i + 1) * n_columns // count)


def _stiff(level: Level, vectors: FloatArray) -> FloatArray:
    """S times vectors."""
    return block_product(level.stiffness, vectors, FAST_COLUMNS)


def _weighted(level: Level, vectors: FloatArray) -> FloatArray:
    """M times vectors."""
    return block_product(level.mass, vectors, FAST_COLUMNS)


def _chunks(array: FloatArray) -> Iterator[slice]:
    """Slices of rows that fit the cache."""
    for start in range(0, len(array), CHUNK):
        yield slice(start, start + CHUNK)


def _dots(a: FloatArray, b: FloatArray) -> FloatArray:
    """Product of each column of one array with the same column of another.

    Sums are in single precision within a chunk of rows, and in double precision over the chunks.
    """
    total = np.zeros(a.shape[1])
    for rows in _chunks(a):
        total += np.einsum("ij,ij->j", a[rows], b[rows])
    return total
