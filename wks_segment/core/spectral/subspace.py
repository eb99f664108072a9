"""Products of sparse matrices with many vectors, and the best eigenpairs within the span of vectors."""

from __future__ import annotations

import numpy as np
from scipy.linalg import LinAlgError, eigh
from scipy.sparse import csr_matrix

from ..mesh.triangle_mesh import FloatArray


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
    subset = None if count is None else [0, count - 1]
    values, rotation = eigh((energy + energy.T) / 2, gram, subset_by_index=subset)
    return values, basis @ rotation.astype(basis.dtype)
