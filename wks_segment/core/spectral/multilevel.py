"""Fast eigensolver: a coarse solve, carried to the surface level by level and corrected there in single precision.

A correction is one step of inverse iteration, x ← x − ω (S + shift M)⁻¹ (S x − λ M x), with the ω from 1 to 2 that
lowers the Rayleigh quotient most. It needs few digits, so that single precision suffices, and its size estimates the
error of a function. Where single precision does not suffice after all, the solve begins again in double precision.
Functions are handed out in panels of columns: those of a large surface are never all in memory.

Ours because no library for all platforms has anything comparable: 300 pairs on 100,000 vertices take SciPy's `eigsh`
71 s and this solver 3.9 s, at an error of the signature of 0.2 to 0.4 % (docs/speed.md), which is less than remeshing
changes the exact signature (0.7 to 2.3 %). LOBPCG with algebraic multigrid did not finish in 150 s.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from scipy.linalg import LinAlgError
from scipy.sparse import csr_matrix

from ..mesh.triangle_mesh import FloatArray
from ..message import Message
from ..progress import Progress
from .coarsening import Level, coarse_eigenpairs
from .multifrontal import SingularError
from .smooth_space import ShiftedOperator, smooth_eigenpairs
from .subspace import block_product, rayleigh_ritz, separate_low_values

CELLS_PER_PAIR = 2.6
"""Cells of the space of smooth functions, which is solved densely, for each pair."""
WIDE_CELLS_PER_PAIR = 5.0
"""Cells of the space of wide functions, for each pair: a second correction costs more than these."""
WIDE_ABOVE = 60_000
"""Number of vertices above which wide functions are tried first, as on cells: they need no second factorization, and on
even shapes one correction suffices. Thin shapes need the smooth functions afterward."""
SPARE_PAIRS, LEAST_SPARE = 0.1, 8
"""Additional pairs, as a fraction of the pairs that are asked for and as a number: a correction may change the order of
pairs."""
SHIFT_PER_PAIR = 0.5
"""Shift of the inverse for each pair that is asked for; a small shift would cost single precision its digits."""
LARGEST_CHANGE, LARGEST_LATER_CHANGE = 0.06, 0.03
"""Largest relative change of a function by its last correction: the remaining error is a small part of it, and the
signature is within 0.2 to 0.6 % of the exact one. The second value holds after a correction that was larger."""
LARGEST_OVERLAP = 0.01
"""Largest overlap of two functions: the coarse space mixes those with almost the same eigenvalue, and a correction does
not part them."""
MAX_CORRECTIONS = 4
"""Most corrections before a coarse space with more cells is tried."""
FACTORED, COARSE_SOLVED, CERTAIN = 0.09, 0.59, 0.95
"""Shares of the time of a solve after which the operator is factorized, the coarse space is solved, and the pairs are
certain: means of five characters, as all shares here."""
FIRST_CORRECTION, ROUND = 0.33, 0.6
"""Share of the time between the last two that the first correction takes, and share of the rest that each further round
takes; most shapes need one or two."""
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
    """The eigenpairs differ from those that were asked for: there are fewer, or they are less accurate.

    Examples
    --------
    >>> import warnings
    >>> from examples.tube import tube
    >>> from wks_segment.core import SpectrumWarning, eigenpairs
    >>> with warnings.catch_warnings(record=True) as told:
    ...     warnings.simplefilter("always", SpectrumWarning)
    ...     values, _ = eigenpairs(tube(0.5, rings=4, around=4), n_pairs=50)
    >>> len(values), len(told)  # the mesh has 18 vertices only
    (18, 1)
    """


class NotConvergedError(ArithmeticError):
    """Corrections stay large, or single precision does not suffice."""


@dataclass(frozen=True)
class _Attempt:
    """A way to solve: first pairs from a coarse space, the cells of that for each pair, precision, most corrections."""

    start: Callable[[ShiftedOperator, int, int, int, Progress], tuple[FloatArray, FloatArray]]
    cells_per_pair: float
    double: bool = False
    corrections: int = MAX_CORRECTIONS


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
            values, vectors = _solve(level, count, n_zero, progress)[1]
            return values, ((columns, vectors[:, columns]) for columns in panels(*vectors.shape))
        prolongation, cells = level.coarsened(MIDDLE_CELLS_PER_PAIR * count + n_zero)
        progress(0.3)
        on_cells, (values, weights) = _solve(cells, count, n_zero, progress.part(0.3, 0.5))
        change = _expected_change(level, prolongation, on_cells, values, weights)
        if not change <= LARGEST_CHANGE:
            raise NotConvergedError("the cells do not represent the functions of the surface")
        correction = _Correction(level, count) if change > LARGEST_UNCORRECTED_CHANGE else None
        progress(0.6)
        return values, _prolonged(prolongation, values, weights, correction, progress.part(0.6, 1.0))
    except (SingularError, LinAlgError) as error:
        raise NotConvergedError(f"single precision does not suffice: {error}") from error


def _solve(
    level: Level, count: int, n_zero: int, progress: Progress
) -> tuple[_Correction, tuple[FloatArray, FloatArray]]:
    """Eigenpairs from a coarse space, corrected on the level until corrections are small, and what corrected them."""
    reason: Exception | None = None
    large = len(level.areas) > WIDE_ABOVE
    attempts = [
        _Attempt(_smooth_start, CELLS_PER_PAIR),
        _Attempt(_smooth_start, 2 * CELLS_PER_PAIR, double=not large),  # of a large level, memory might not suffice
    ]
    if large or not level.is_surface:
        attempts.insert(0, _Attempt(_wide_start, WIDE_CELLS_PER_PAIR, corrections=1))
    n_pairs = round((1 + SPARE_PAIRS) * count) + LEAST_SPARE
    corrections: dict[bool, _Correction] = {}
    for attempt in attempts:
        n_cells = max(round(attempt.cells_per_pair * count), 2 * (count + n_zero))
        if n_cells >= len(level.areas):
            continue
        try:
            if attempt.double not in corrections:
                precise = level.in_double_precision() if attempt.double else level
                corrections = {attempt.double: _Correction(precise, count)}  # the former one is freed
            correction = corrections[attempt.double]
            progress(FACTORED)
            pairs = attempt.start(correction.operator, n_cells, n_zero, n_pairs, progress.part(FACTORED, COARSE_SOLVED))
            progress(COARSE_SOLVED)
            shares = progress.part(COARSE_SOLVED, CERTAIN)
            found = _corrected(correction, pairs, count, attempt.corrections, shares)
        except (SingularError, LinAlgError) as error:
            found, reason = None, error
        if found is not None:
            progress(CERTAIN)
            return correction, found
        progress = progress.part(CERTAIN, 1.0)
    raise NotConvergedError("corrections stay large, or single precision does not suffice") from reason


def _smooth_start(
    operator: ShiftedOperator, n_cells: int, n_zero: int, count: int, progress: Progress
) -> tuple[FloatArray, FloatArray]:
    """Approximate pairs in the space of smooth functions."""
    values, sources, weights = smooth_eigenpairs(operator, n_cells, count, progress.part(0.0, 0.9))
    progress(0.9)
    vectors = np.empty((len(operator.level.areas), len(values)), dtype=operator.dtype)
    for columns in panels(*vectors.shape):
        vectors[:, columns] = operator.factor.solve(sources @ np.ascontiguousarray(weights[:, columns]))
    return values, vectors


def _wide_start(
    operator: ShiftedOperator, n_cells: int, n_zero: int, count: int, progress: Progress
) -> tuple[FloatArray, FloatArray]:
    """Approximate pairs in the space of wide functions."""
    prolongation, cells = operator.level.coarsened(n_cells, wide=True)
    progress(0.6)
    values, weights = coarse_eigenpairs(cells, n_zero, count)
    return values, block_product(prolongation, weights, FAST_COLUMNS)


def _corrected(
    correction: _Correction, pairs: tuple[FloatArray, FloatArray], count: int, corrections: int, progress: Progress
) -> tuple[FloatArray, FloatArray] | None:
    """The lowest `count` pairs after at most so many corrections; None if these stay large or there are fewer pairs.

    After the first correction all functions are made orthogonal, unless they are so or `corrections` is 1.
    """
    (values, vectors), level = pairs, correction.level
    if len(values) < count:
        return None
    limit, done, end = LARGEST_CHANGE, 0.0, FIRST_CORRECTION
    for left in reversed(range(corrections)):
        changes, overlap = np.empty(len(values)), 0.0
        for columns in panels(*vectors.shape):
            panel = np.ascontiguousarray(vectors[:, columns])
            values[columns], changes[columns] = correction(values[columns], panel)
            overlap = max(overlap, _overlap(level, panel))
            vectors[:, columns] = panel
            progress(done + (end - done) * columns.stop / len(values))
        converged = changes[:count].max() <= limit
        if not converged and not left:
            return None
        done, limit = end, LARGEST_LATER_CHANGE
        end += ROUND * (1 - end)
        if not converged or (left and overlap > LARGEST_OVERLAP):
            middle = (done + end) / 2
            values, vectors = _lowest_in_span(level, vectors, progress.part(done, middle))
            done = middle
        if converged:
            break
    separate_low_values(level, values, vectors)
    order = np.argsort(values, kind="stable")[:count]
    return values[order], vectors[:, order].astype(np.float32, copy=False)


class _Correction:
    """Correction of approximate eigenpairs on a level; see the docstring of the module."""

    def __init__(self, level: Level, count: int) -> None:
        self.level = level
        self.operator = ShiftedOperator(level, SHIFT_PER_PAIR * count)
        self.shift = self.operator.shift

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
        return self.operator.factor.solve(residual), residual, weighted


def _lowest_in_span(level: Level, basis: FloatArray, progress: Progress) -> tuple[FloatArray, FloatArray]:
    """The non-zero eigenpairs within the span of a basis."""
    zero_modes = level.zero_modes()
    basis = np.asarray(basis - zero_modes @ (_weighted(level, zero_modes).T @ basis))
    energy = basis.T @ _stiff(level, basis)
    progress(0.3)
    squares = basis.T @ _weighted(level, basis)
    progress(0.8)  # before the dense eigenproblem, which cannot report
    return rayleigh_ritz(basis, energy, squares)


def _overlap(level: Level, vectors: FloatArray) -> float:
    """Largest product of two M-normalized vectors, which is 0 if they are orthogonal."""
    products = np.abs(vectors.T @ _weighted(level, vectors))
    np.fill_diagonal(products, 0)
    return float(products.max())


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
        conditioned = jacobi * residual + prolongation @ on_cells.operator.factor.solve(prolongation.T @ residual)
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
