"""The exact eigensolver: block Lanczos on a shifted inverse, with every pair checked and none missed.

The shift lies inside the spectrum, below the last pairs that are asked for: these converge slowest, and near to the
shift they converge soon, so that the basis stays small (Ericsson and Ruhe, 1980). The factorization counts the
eigenvalues below its shift, which shows whether a pair was missed.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.linalg import LinAlgError, eigh
from scipy.sparse import csr_matrix, identity

from ..mesh.triangle_mesh import FloatArray
from .coarsening import Level, coarse_eigenpairs
from .multifrontal import NestedDissectionFactor, SingularError

TOLERANCE = 1e-8
"""Largest relative residual, and largest departure from orthonormality."""
ROUNDING = 16 * np.finfo(np.float64).eps
"""What rounding alone leaves of a residual, as a fraction of the operator's norm: felt where triangles are thin."""
MAX_REPAIRS = 5
"""Rounds in which missed pairs are looked for before the solve counts as failed."""
MAX_POLISHES = 8
"""Steps in which residuals that are too large are reduced."""
BLOCK = 16
"""Columns in a block."""
SHIFT_WITHIN = 0.65
"""Place of the shift, as a fraction of the last value that is asked for."""
NEARBY_SHIFTS = (1.0, 0.97, 1.03, 0.94)
"""Multiples of the shift that are tried until a solve is accurate."""
SOLVE_TOLERANCE = 1e-10
"""Relative residual of a solve that is accurate enough: one step of refinement does the rest where it matters."""
CELLS_PER_PAIR = 2.0
"""Size of the coarse space that tells the last value beforehand, and the functions that Lanczos starts from."""
FIRST_LOOK, LOOK_AGAIN = 1.7, 1.06
"""Convergence is looked at when there are this many basis vectors a pair, and then this many times more."""
LAST_LOOK = 4.0
"""From this many basis vectors a pair on, a value below the shift that is still missing is left to the repair."""
SPENT = 1e-12
"""Size of a new direction, relative to what it comes from, below which it is rounding."""
COLUMNS = 32
"""Columns in one sparse product: what a row and its neighbors need should stay in the cache."""
LANCZOS_TOLERANCE = 1e-10
"""Residual of the inverse at which Lanczos ends, relative to the value."""


class SpectrumError(RuntimeError):
    """The eigenpairs could not be computed to the accuracy asked for."""


def lanczos_eigenpairs(
    operator: csr_matrix, level: Level, zero_modes: FloatArray, count: int, tick: Callable[[float], None]
) -> tuple[FloatArray, FloatArray]:
    """The lowest `count` eigenpairs of a symmetric (n, n) operator beside its known zero modes.

    Parameters
    ----------
    operator : (n, n) sparse matrix of float64
        A = M^-½ S M^-½.
    level : Level
        The same problem as S x = λ M x.
    zero_modes : (n, c) array
        Orthonormal.
    count : int
    tick : callable
        Called with the share of the work that is done, 0 to 1.

    Raises
    ------
    SpectrumError
        If the checks fail.
    """
    highest, start = _forecast(level, zero_modes, count)
    tick(0.05)

    shift, factor = _stable_factor(operator, level, SHIFT_WITHIN * highest, start)
    # One pair more, so that the inertia count has a gap to stand in behind the last pair that is handed out.
    values, vectors = _block_lanczos(factor, shift, zero_modes, start, count + 1, lambda share: tick(0.1 + 0.7 * share))
    _polish(operator, factor, shift, zero_modes, values, vectors)
    tick(0.9)
    for _ in range(MAX_REPAIRS):
        place = _widest_gap(values, count)
        below = _factor(operator, level, (values[place - 1] + values[place]) / 2).n_negative
        missed = below - place - zero_modes.shape[1]
        if missed <= 0:
            break
        known = np.hstack([zero_modes, vectors])
        if known.shape[1] + missed > len(known):
            raise SpectrumError(f"{missed} of {count} eigenpairs were not found")
        again = np.random.default_rng(known.shape[1]).standard_normal(start.shape)
        more = _block_lanczos(factor, shift, known, again, missed, lambda share: tick(0.9))[1]
        values, vectors = _rayleigh_ritz(operator, np.hstack([vectors, more]), zero_modes)
        _polish(operator, factor, shift, zero_modes, values, vectors)
    else:
        raise SpectrumError(f"{missed} of {count} eigenpairs were not found")
    values, vectors = values[:count], vectors[:, :count]
    check(operator, values, vectors)
    return values, vectors


def _factor(operator: csr_matrix, level: Level, shift: float) -> NestedDissectionFactor:
    """Of A − shift."""
    shifted = csr_matrix(operator - shift * identity(operator.shape[0], format="csr"))
    try:
        return NestedDissectionFactor(shifted, level.positions, np.float64)
    except SingularError as error:
        raise SpectrumError(f"the operator cannot be factorized, its triangles are too thin: {error}") from error


def _stable_factor(
    operator: csr_matrix, level: Level, shift: float, right: FloatArray
) -> tuple[float, NestedDissectionFactor]:
    """A shift near the one given that is no eigenvalue of a part of the surface, and the factor there.

    At one, a front is nearly singular, and the solution loses digits.
    """
    best: tuple[float, float, NestedDissectionFactor] | None = None
    for nearby in NEARBY_SHIFTS:
        factor = _factor(operator, level, nearby * shift)
        solution = factor.solve(right)
        left = operator @ solution - nearby * shift * solution - right
        error = float(np.linalg.norm(left) / np.linalg.norm(right))
        if best is None or error < best[0]:
            best = error, nearby * shift, factor
        if error <= SOLVE_TOLERANCE:
            break
    assert best is not None
    return best[1:]


def _forecast(level: Level, zero_modes: FloatArray, count: int) -> tuple[float, FloatArray]:
    """The last value asked for, roughly, and a block in which all functions up to there take part."""
    generator = np.random.default_rng(0)
    start = generator.standard_normal((len(zero_modes), BLOCK))
    try:
        prolongation, cells = level.coarsened(round(CELLS_PER_PAIR * count), wide=True)
        values, weights = coarse_eigenpairs(cells, zero_modes.shape[1], count)
    except LinAlgError:
        values = np.zeros(0)
    if not values.size or not values[-1] > 0:
        return 4 * np.pi * count, start  # Weyl's law
    smooth = prolongation @ (weights @ generator.standard_normal((weights.shape[1], BLOCK)))
    smooth *= np.sqrt(level.mass.diagonal())[:, None]
    # A little of everything, for what the coarse space does not see.
    start *= 0.1 * np.linalg.norm(smooth) / np.linalg.norm(start)
    return float(values[-1]), smooth + start


def _block_lanczos(
    factor: NestedDissectionFactor,
    shift: float,
    known: FloatArray,
    start: FloatArray,
    count: int,
    tick: Callable[[float], None],
) -> tuple[FloatArray, FloatArray]:
    """The lowest positive eigenvalues of A, rising, and (n, count) eigenvectors orthogonal to the `known` vectors.

    `factor` is that of A − shift. In blocks, so that equal eigenvalues are seen, and with full reorthogonalisation, all
    of it matrix products (Golub and Underwood, 1977).
    """
    n = len(known)
    largest = n - known.shape[1]
    width = min(BLOCK, largest)
    next_look = FIRST_LOOK * count
    space = np.empty((n, min(int(1.4 * next_look) + 3 * width, largest)), order="F")
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
        spent = np.abs(coupling.diagonal()) <= SPENT * np.linalg.norm(diagonal)
        if spent.any() and size + width <= largest:
            # What the start could reach is all there: equal eigenvalues beyond the width of a block are not in it.
            fresh = generator.standard_normal((n, int(spent.sum())))
            block[:, spent] = _orthonormal_to(np.hstack([known, basis, block[:, ~spent]]), fresh)
            coupling[spent] = 0
        tick(min(size / (2.5 * count), 1.0))
        exhausted = size + width > largest
        if exhausted or size >= next_look:
            next_look *= LOOK_AGAIN
            inverses, weights = np.linalg.eigh(projected)
            ritz = shift + 1 / inverses
            lowest = np.argsort(np.where(ritz > 0, ritz, np.inf), kind="stable")[:count]
            weights = np.ascontiguousarray(weights[:, lowest])
            # Residual of each Ritz pair: what the next block still couples to it.
            left = np.linalg.norm(coupling @ weights[-width:], axis=0)
            missing = factor.n_negative - known.shape[1] - np.count_nonzero(ritz[lowest] < shift)
            complete = missing <= 0 or size > LAST_LOOK * count
            if exhausted or (complete and (left <= LANCZOS_TOLERANCE * np.abs(inverses[lowest])).all()):
                return ritz[lowest], basis @ weights


def _polish(
    operator: csr_matrix,
    factor: NestedDissectionFactor,
    shift: float,
    zero_modes: FloatArray,
    values: FloatArray,
    vectors: FloatArray,
) -> None:
    """Correct the pairs whose residual is too large by inverse iteration, in place.

    Lanczos and Rayleigh–Ritz leave functions far from the shift, and those of a thread of triangles, some digits short.
    A whole step, ψ − (A − shift)⁻¹ (A ψ − λ ψ), multiplies an error of eigenvalue μ by (λ − shift) / (μ − shift), which
    takes away all that is far up, but lets what lies between the last value that is known and 2 shift − λ grow: every
    other step is so much shorter that it takes away this.
    """
    for i in range(MAX_POLISHES):
        off = _residuals(operator, values, vectors) > TOLERANCE / 2
        if not off.any():
            return
        worst_growth = (shift - values[off]) / (values[-1] - shift)
        length = np.where((worst_growth > 1) & (i % 2 == 1), 2 / (worst_growth + 3), 1)
        better = vectors[:, off]
        better -= factor.solve(operator @ better - better * values[off]) * length
        vectors[:, off] = _orthonormal_to(np.hstack([zero_modes, vectors[:, ~off]]), better)
        # Over all: what is left of the residual of a high function can be large along a low one.
        values[:], rotation = eigh(vectors.T @ _times(operator, vectors))
        vectors[:] = vectors @ rotation


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


def _residuals(operator: csr_matrix, values: FloatArray, vectors: FloatArray) -> FloatArray:
    """Relative residual ‖A ψ − λ ψ‖ / λ of each pair, beyond what rounding explains."""
    # A first eigenvalue far below 1 (parts that hang by a thread) is measured against 1.
    rounding = ROUNDING * abs(operator).sum(axis=0).max()
    residuals = np.empty(len(values))
    for start in range(0, len(values), COLUMNS):
        columns = slice(start, start + COLUMNS)
        image = operator @ np.ascontiguousarray(vectors[:, columns])
        image -= vectors[:, columns] * values[columns]
        residuals[columns] = np.linalg.norm(image, axis=0)
    return np.asarray(np.maximum(residuals - rounding, 0) / np.maximum(values, 1))


def _times(operator: csr_matrix, vectors: FloatArray) -> FloatArray:
    """operator @ vectors, in blocks of columns."""
    image = np.empty_like(vectors)
    for start in range(0, vectors.shape[1], COLUMNS):
        columns = slice(start, start + COLUMNS)
        image[:, columns] = operator @ np.ascontiguousarray(vectors[:, columns])
    return image


def check(operator: csr_matrix, values: FloatArray, vectors: FloatArray) -> None:
    """Raise SpectrumError unless the pairs are pairs and the vectors orthonormal."""
    largest = float(_residuals(operator, values, vectors).max())
    departure = np.abs(vectors.T @ vectors - np.eye(len(values))).max()
    if not max(largest, departure) <= TOLERANCE:
        raise SpectrumError(
            f"the eigenpairs are not accurate enough: relative residual {largest:.1e}, departure from "
            f"orthonormality {departure:.1e}, allowed {TOLERANCE:.0e}"
        )
