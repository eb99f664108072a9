"""Products of sparse matrices with many vectors, and the best eigenpairs within the span of vectors."""

from __future__ import annotations

import numpy as np
from scipy.linalg import LinAlgError, eigh
from scipy.sparse import csr_matrix, find, triu

from ..mesh.triangle_mesh import FloatArray
from .coarsening import Level

LOW_VALUE = 1e-3
"""Fraction of the last eigenvalue below which single precision does not suffice for an eigenvalue."""
PAIRS_AT_ONCE = 100_000
"""Pairs of vertices whose energies are summed at once, so that they need little memory."""


def block_product(matrix: csr_matrix, vectors: FloatArray, width: int) -> FloatArray:
    """Product of a sparse (n, n') matrix with (n', k) vectors, `width` columns at a time so that they fit the cache."""
    if matrix.nnz == matrix.shape[0] and (diagonal := matrix.diagonal()).all():  # a lumped mass matrix
        return np.asarray(vectors * diagonal[:, None])
    if vectors.shape[1] <= width:
        return np.asarray(matrix @ np.ascontiguousarray(vectors))
    result: FloatArray = np.empty((matrix.shape[0], vectors.shape[1]), dtype=vectors.dtype)
    for start in range(0, vectors.shape[1], width):
        columns = slice(start, start + width)
        result[:, columns] = matrix @ np.ascontiguousarray(vectors[:, columns])
    return result


def rayleigh_ritz(
    basis: FloatArray, energy: FloatArray, gram: FloatArray, count: int | None = None
) -> tuple[FloatArray, FloatArray]:
    """Best approximations of eigenpairs of S x = λ M x within the span of a basis (Rayleigh and Ritz).

    Parameters
    ----------
    basis : (n, k) array
        Linearly independent.
    energy, gram : (k, k) arrays
        Bᵀ S B and Bᵀ M B of the basis B.
    count : int, optional
        Number of pairs, the lowest ones; k if not given.

    Returns
    -------
    (count,) values, rising, and (n, count) M-orthonormal vectors in the precision of the basis.

    Raises
    ------
    scipy.linalg.LinAlgError
        If an entry is not finite, or the basis is linearly dependent.
    """
    energy, gram = energy.astype(np.float64), gram.astype(np.float64)
    if not (np.isfinite(energy).all() and np.isfinite(gram).all()):
        raise LinAlgError("the products of the basis are not finite")
    # All pairs take less time than some: LAPACK then divides and conquers.
    values, rotation = eigh((energy + energy.T) / 2, gram)
    return values[:count], basis @ rotation[:, :count].astype(basis.dtype)


def separate_low_values(level: Level, values: FloatArray, vectors: FloatArray) -> None:
    """Compute values far below the last one, and their vectors, in double precision, in place.

    Parts of a surface that hang together by a thin neck have such values, and the signature takes their logarithm. An
    energy is a sum over pairs of vertices, because single precision loses the small sum of large products x S x.
    """
    low = np.flatnonzero(values < LOW_VALUE * values.max())
    if not low.size:
        return
    zero_modes, masses = level.zero_modes().astype(np.float64), level.mass.astype(np.float64)
    basis = vectors[:, low].astype(np.float64)
    basis -= zero_modes @ (zero_modes.T @ (masses @ basis))
    first, second, couplings = find(triu(level.stiffness, 1))
    energy = np.zeros((low.size, low.size))
    for start in range(0, len(couplings), PAIRS_AT_ONCE):
        pairs = slice(start, start + PAIRS_AT_ONCE)
        across = basis[first[pairs]] - basis[second[pairs]]
        energy -= (across * couplings[pairs, None].astype(np.float64)).T @ across
    values[low], vectors[:, low] = rayleigh_ritz(basis, energy, basis.T @ (masses @ basis))
