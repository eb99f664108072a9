"""Dense eigenpairs are those of SciPy, computed without Python's lock."""

import numpy as np
import pytest
from scipy.linalg import LinAlgError, eigh, solve_triangular

from wks_segment.core.spectral import dense_eigen
from wks_segment.core.spectral.dense_eigen import SOLVE_COLUMNS, lowest_eigenpairs, solve_lower_triangular


def symmetric(n):
    matrix = np.random.default_rng(n).standard_normal((n, n)).astype(np.float32)
    return matrix + matrix.T


@pytest.mark.parametrize(("n", "count"), [(1, 1), (5, 9), (90, 7), (300, 300)])
def test_eigenpairs_are_those_of_scipy(n, count):
    matrix = symmetric(n)
    values, vectors = lowest_eigenpairs(matrix, count)
    expected, directions = eigh(matrix, subset_by_index=[0, min(n, count) - 1])
    np.testing.assert_allclose(values, expected, rtol=1e-4, atol=1e-4)
    np.testing.assert_allclose(np.abs((vectors * directions).sum(axis=0)), 1, atol=1e-3)
    assert (values.dtype, vectors.dtype, vectors.shape) == (np.float32, np.float32, (n, min(n, count)))


def test_scipy_is_called_if_its_lapack_has_another_interface(monkeypatch):
    matrix = symmetric(40)
    values, vectors = lowest_eigenpairs(matrix, 5)
    monkeypatch.setattr(dense_eigen, "_syevr", lambda: None)
    others, directions = lowest_eigenpairs(matrix, 5)
    np.testing.assert_allclose(values, others, rtol=1e-4)
    np.testing.assert_allclose(np.abs((vectors * directions).sum(axis=0)), 1, atol=1e-3)


def test_lapack_of_the_installed_scipy_is_called_directly():
    assert dense_eigen._syevr() is not None


def test_the_matrix_does_not_change():
    matrix = np.asfortranarray(symmetric(20))
    before = matrix.copy()
    lowest_eigenpairs(matrix, 3)
    np.testing.assert_array_equal(matrix, before)


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_an_entry_that_is_not_finite_is_an_error(bad):
    matrix = symmetric(4)
    matrix[2, 1] = bad
    with pytest.raises(LinAlgError, match="not finite"):
        lowest_eigenpairs(matrix, 2)


@pytest.mark.parametrize("transposed", [False, True])
def test_solving_in_blocks_of_columns_changes_nothing(transposed):
    matrix = symmetric(60)
    factor = np.linalg.cholesky(matrix @ matrix.T + 60 * np.eye(60, dtype=np.float32))
    right = np.random.default_rng(0).standard_normal((60, 2 * SOLVE_COLUMNS + 3)).astype(np.float32)
    expected = solve_triangular(factor, right, lower=True, trans=int(transposed))
    np.testing.assert_allclose(solve_lower_triangular(factor, right, transposed), expected, atol=1e-5)
