"""Exact eigensolver: block Lanczos on a shifted inverse; every pair is checked, and an inertia count finds missed ones.

The shift lies inside the spectrum, below the last pairs that are asked for. These would converge slowest, and converge
fast next to the shift, so that the basis stays small (Ericsson and Ruhe, 1980). The factorization counts the
eigenvalues below its shift, which shows whether a pair was missed.

Ours because SciPy's `eigsh` spends most of its time in its own orthogonalization: for 300 pairs on 100,000 vertices it
took 71 s and this solver 19 s, on 20,000 vertices 12.8 and 3.2 s (docs/speed.md).
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import LinAlgError, eigh
from scipy.sparse import csr_matrix, identity

from ..mesh.triangle_mesh import FloatArray
from ..message import Message
from ..progress import Progress
from .coarsening import Level, coarse_eigenpairs
from .multifrontal import MultifrontalFactor, SingularError
from .subspace import block_product, rayleigh_ritz

EXACT_TOLERANCE = 1e-8
"""Largest relative residual, and largest departure from orthonormality, of an exact solve."""
ROUNDING = 16 * np.finfo(np.float64).eps
"""Part of a residual that rounding explains, as a fraction of the norm of the operator: it matters for thin
triangles."""
MAX_REPAIRS = 5
"""Most rounds of searching for missed pairs, before the solve counts as failed."""
MAX_POLISHES = 8
"""Most steps of reducing residuals that are too large."""
BLOCK = 16
"""Columns in a block."""
SHIFT_WITHIN = 0.65
"""Position of the shift, as a fraction of the last eigenvalue that is asked for."""
NEARBY_SHIFTS = (1.0, 0.97, 1.03, 0.94)
"""Multiples of the shift that are tried until a solve is accurate."""
SOLVE_TOLERANCE = 1e-10
"""Relative residual of a solve that is accurate enough; polishing does the rest where it matters."""
FORECAST_CELLS_PER_PAIR = 2.0
"""Cells of the coarse space that forecasts the last eigenvalue and gives the first block, for each pair."""
FIRST_CHECK, NEXT_CHECK = 1.7, 1.06
"""Convergence is checked when the basis has this many vectors for each pair, and then whenever it has grown by this
factor."""
LAST_CHECK = 4.0
"""Basis vectors for each pair, above which eigenvalues missing below the shift are left to the repair."""
EXHAUSTED = 1e-12
"""Size of a new direction, relative to the vectors that it comes from, below which it is rounding."""
EXACT_COLUMNS = 32
"""Columns in one sparse product: a row and its neighbors should fit the cache."""
LANCZOS_TOLERANCE = 1e-10
"""Residual of the inverse at which Lanczos ends, relative to the value."""


class SpectrumError(RuntimeError):
    """The eigenpairs could not be computed with the required accuracy.

    Examples
    --------
    >>> from wks_segment.core import SpectrumError
    >>> issubclass(SpectrumError, Exception)
    True
    """


def lanczos_eigenpairs(
    operator: csr_matrix, level: Level, zero_modes: FloatArray, count: int, progress: Progress
) -> tuple[FloatArray, FloatArray]:
    """The lowest `count` eigenpairs of a symmetric operator besides its known zero modes.

    Parameters
    ----------
    operator : (n, n) sparse matrix of float64
        A = M^-½ S M^-½.
    level : Level
        The same problem as S x = λ M x.
    zero_modes : (n, c) array
        Orthonormal null space of A.
    count : int
    progress : Progress

    Returns
    -------
    (count,) eigenvalues, rising, and (n, count) orthonormal eigenvectors.

    Raises
    ------
    SpectrumError
        If pairs are missing or not accurate.
    """
    highest, start = _forecast(level, zero_modes, count)
    progress(0.05)

    shift, factor = _stable_factor(operator, level, SHIFT_WITHIN * highest, start)
    # One pair more, so that a gap follows the last pair of the result, in which the inertia count can take place.
    values, vectors = _block_lanczos(factor, shift, zero_modes, start, count + 1, progress.part(0.1, 0.8))
    _polish(operator, factor, shift, zero_modes, values, vectors)
    progress(0.9)
    for _ in range(MAX_REPAIRS):
        place = _widest_gap(values, count)
        below = _factor(operator, level, (values[place - 1] + values[place]) / 2).n_negative
        missed = below - place - zero_modes.shape[1]
        if missed <= 0:
            break
        known = np.hstack([zero_modes, vectors])
        if known.shape[1] + missed > len(known):
            raise SpectrumError(_missed_pairs(missed, count))
        again = np.random.default_rng(known.shape[1]).standard_normal(start.shape)
        more = _block_lanczos(factor, shift, known, again, missed, progress.part(0.9, 0.9))[1]
        basis = np.hstack([vectors, more])
        basis = basis - zero_modes @ (zero_modes.T @ basis)
        values, vectors = rayleigh_ritz(basis, basis.T @ (operator @ basis), basis.T @ basis)
        _polish(operator, factor, shift, zero_modes, values, vectors)
    else:
        raise SpectrumError(_missed_pairs(missed, count))
    values, vectors = values[:count], vectors[:, :count]
    check_eigenpairs(operator, values, vectors)
    return values, vectors


def _missed_pairs(missed: int, count: int) -> Message:
    return Message("{missed} of {count} eigenpairs were not found", missed=missed, count=count)


def _factor(operator: csr_matrix, level: Level, shift: float) -> MultifrontalFactor:
    """Factor of A − shift."""
    shifted = csr_matrix(operator - shift * identity(operator.shape[0], format="csr"))
    try:
        return MultifrontalFactor(shifted, level.positions, np.float64)
    except SingularError as error:
        raise SpectrumError("the eigenpairs cannot be computed: the triangles of the mesh are too thin") from error


def _stable_factor(
    operator: csr_matrix, level: Level, shift: float, right: FloatArray
) -> tuple[float, MultifrontalFactor]:
    """A shift near the given one at which solves are accurate, and the factor there.

    At an eigenvalue of a part of the surface, a front is nearly singular and the solution loses digits.
    """
    best: tuple[float, float, MultifrontalFactor] | None = None
    for nearby in NEARBY_SHIFTS:
        factor = _factor(operator, level, nearby * shift)
        solution = factor.solve(right)
        residual = operator @ solution - nearby * shift * solution - right
        error = float(np.linalg.norm(residual) / np.linalg.norm(right))
        if best is None or error < best[0]:
            best = error, nearby * shift, factor
        if error <= SOLVE_TOLERANCE:
            break
    assert best is not None
    return best[1:]


def _forecast(level: Level, zero_modes: FloatArray, count: int) -> tuple[float, FloatArray]:
    """Rough value of the last eigenvalue, and a block to which all eigenvectors up to there contribute."""
    generator = np.random.default_rng(0)
    start = generator.standard_normal((len(zero_modes), BLOCK))
    try:
        prolongation, cells = level.coarsened(round(FORECAST_CELLS_PER_PAIR * count), wide=True)
        values, weights = coarse_eigenpairs(cells, zero_modes.shape[1], count)
    except LinAlgError:
        values = np.zeros(0)
    if not values.size or not values[-1] > 0:
        return 4 * np.pi * count, start  # Weyl's law
    smooth = prolongation @ (weights @ generator.standard_normal((weights.shape[1], BLOCK)))
    smooth *= np.sqrt(level.mass.diagonal())[:, None]
    # A little noise, for functions that are not in the coarse space.
    start *= 0.1 * np.linalg.norm(smooth) / np.linalg.norm(start)
    return float(values[-1]), smooth + start


def _block_lanczos(
    factor: MultifrontalFactor,
    shift: float,
    known: FloatArray,
    start: FloatArray,
    count: int,
    progress: Progress,
) -> tuple[FloatArray, FloatArray]:
    """The lowest positive eigenvalues of A, rising, and (n, count) eigenvectors orthogonal to the `known` vectors.

    `factor` is the factor of A − shift. Blocks find equal eigenvalues, and reorthogonalization is complete, all of it
    in matrix products (Golub and Underwood, 1977).
    """
    n = len(known)
    largest = n - known.shape[1]
    width = min(BLOCK, largest)
    next_check = FIRST_CHECK * count
    space = np.empty((n, min(int(1.4 * next_check) + 3 * width, largest)), order="F")
    projected = np.zeros((0, 0))
    generator = np.random.default_rng(known.shape[1])
    block, coupling = _orthonormal_to(known, start[:, :width]), np.zeros((width, width))
    while True:
        old, size = len(projected), len(projected) + width
        if size > space.shape[1]:
            space = np.concatenate([space, np.empty((n, space.shape[1] // 5 + width), order="F")], axis=1)
        space[:, old:size] = block
        basis = space[:, :size]
        image = factor.solve(block)
        # In exact arithmetic the image has only parts in the last two blocks: the matrix is block tridiagonal.
        diagonal = block.T @ image
        projected = np.pad(projected, (0, width))
        projected[old:, old:] = (diagonal + diagonal.T) / 2
        image -= block @ diagonal
        if old:
            projected[old:, old - width : old] = coupling
            projected[old - width : old, old:] = coupling.T
            image -= space[:, old - width : old] @ coupling.T
        # Rounding brings the other blocks back.
        image -= known @ (known.T @ image)
        image -= basis @ (basis.T @ image)
        block, coupling = np.linalg.qr(image)
        exhausted_columns = np.abs(coupling.diagonal()) <= EXHAUSTED * np.linalg.norm(diagonal)
        if exhausted_columns.any() and size + width <= largest:
            # The basis holds all that the start could reach; more equal eigenvalues than a block has columns are not.
            fresh = generator.standard_normal((n, int(exhausted_columns.sum())))
            block[:, exhausted_columns] = _orthonormal_to(
                np.hstack([known, basis, block[:, ~exhausted_columns]]), fresh
            )
            coupling[exhausted_columns] = 0
        progress(min(size / (2.5 * count), 1.0))
        complete_space = size + width > largest
        if complete_space or size >= next_check:
            next_check *= NEXT_CHECK
            values, weights, converged = _lowest_ritz_pairs(projected, coupling, shift, count)
            missing = factor.n_negative - known.shape[1] - np.count_nonzero(values < shift)
            found_all = missing <= 0 or size > LAST_CHECK * count
            if complete_space or (found_all and converged):
                return values, basis @ weights


def _lowest_ritz_pairs(
    projected: FloatArray, coupling: FloatArray, shift: float, count: int
) -> tuple[FloatArray, FloatArray, bool]:
    """The lowest positive Ritz values of A, the weights of their vectors in the basis, and whether they converged.

    `projected` is the inverse of A − shift in the basis, `coupling` its part between the last block and the next one.
    """
    inverses, weights = np.linalg.eigh(projected)
    ritz = shift + 1 / inverses
    lowest = np.argsort(np.where(ritz > 0, ritz, np.inf), kind="stable")[:count]
    weights = np.ascontiguousarray(weights[:, lowest])
    # The residual of a Ritz pair is its part in the next block.
    residuals = np.linalg.norm(coupling @ weights[-len(coupling) :], axis=0)
    return ritz[lowest], weights, bool((residuals <= LANCZOS_TOLERANCE * np.abs(inverses[lowest])).all())


def _polish(
    operator: csr_matrix,
    factor: MultifrontalFactor,
    shift: float,
    zero_modes: FloatArray,
    values: FloatArray,
    vectors: FloatArray,
) -> None:
    """Correct the pairs whose residual is too large by inverse iteration, in place.

    Lanczos and Rayleigh–Ritz lose some digits of eigenvectors far from the shift and of those on thin triangles. A
    full step, ψ − (A − shift)⁻¹ (A ψ − λ ψ), multiplies an error of eigenvalue μ by (λ − shift) / (μ − shift). This
    removes errors of high eigenvalues, but amplifies those between the last known value and 2 shift − λ; every other
    step is shortened so that it removes the latter.
    """
    for i in range(MAX_POLISHES):
        inaccurate = _residuals(operator, values, vectors) > EXACT_TOLERANCE / 2
        if not inaccurate.any():
            return
        worst_growth = (shift - values[inaccurate]) / (values[-1] - shift)
        length = np.where((worst_growth > 1) & (i % 2 == 1), 2 / (worst_growth + 3), 1)
        better = vectors[:, inaccurate]
        better -= factor.solve(operator @ better - better * values[inaccurate]) * length
        vectors[:, inaccurate] = _orthonormal_to(np.hstack([zero_modes, vectors[:, ~inaccurate]]), better)
        # Over all vectors: the rest of a high one's residual can have a large part along a low one.
        values[:], rotation = eigh(vectors.T @ block_product(operator, vectors, EXACT_COLUMNS))
        vectors[:] = vectors @ rotation


def _orthonormal_to(basis: FloatArray, block: FloatArray) -> FloatArray:
    """Orthonormal columns that span a block and are orthogonal to a basis; two rounds suffice (Kahan and Parlett)."""
    for _ in range(2):
        block = np.linalg.qr(block - basis @ (basis.T @ block))[0]
    return block


def _widest_gap(values: FloatArray, count: int) -> int:
    """Index after the widest gap between consecutive values, at or after the last pair of the result.

    An inertia count between two almost equal eigenvalues would depend on rounding.
    """
    return count + int(np.argmax(np.diff(values[count - 1 :])))


def _residuals(operator: csr_matrix, values: FloatArray, vectors: FloatArray) -> FloatArray:
    """Relative residual ‖A ψ − λ ψ‖ / λ of each pair, beyond what rounding explains."""
    # A first eigenvalue far below 1 (two parts joined by a thin neck) is measured relative to 1.
    rounding = ROUNDING * abs(operator).sum(axis=0).max()
    residuals = np.empty(len(values))
    for start in range(0, len(values), EXACT_COLUMNS):
        columns = slice(start, start + EXACT_COLUMNS)
        image = operator @ np.ascontiguousarray(vectors[:, columns])
        image -= vectors[:, columns] * values[columns]
        residuals[columns] = np.linalg.norm(image, axis=0)
    return np.asarray(np.maximum(residuals - rounding, 0) / np.maximum(values, 1))


def check_eigenpairs(operator: csr_matrix, values: FloatArray, vectors: FloatArray) -> None:
    """Raise SpectrumError unless residuals and departure from orthonormality are at most `EXACT_TOLERANCE`."""
    residual = float(_residuals(operator, values, vectors).max())
    departure = float(np.abs(vectors.T @ vectors - np.eye(len(values))).max())
    if not max(residual, departure) <= EXACT_TOLERANCE:
        raise SpectrumError(
            Message(
                "the eigenpairs are not accurate enough: relative residual {residual:.1e}, departure from "
                "orthonormality {departure:.1e}, allowed {allowed:.0e}",
                residual=residual,
                departure=departure,
                allowed=EXACT_TOLERANCE,
            )
        )
