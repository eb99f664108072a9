"""Dense eigenpairs: SciPy's, but without Python's lock."""

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


def test_where_the_function_is_another_it_is_scipys_call(monkeypatch):
    matrix = symmetric(40)
    values, vectors = lowest_eigenpairs(matrix, 5)
    monkeypatch.setattr(dense_eigen, "_syevr", lambda: None)
    others, directions = lowest_eigenpairs(matrix, 5)
    np.testing.assert_allclose(values, others, rtol=1e-4)
    np.testing.assert_allclose(np.abs((vectors * directions).sum(axis=0)), 1, atol=1e-3)


def test_bundled_scipy_is_called_without_the_lock():
    assert dense_eigen._syevr() is not None


def test_matrix_is_left_as_it_was():
    matrix = np.asfortranarray(symmetric(20))
    before = matrix.copy()
    lowest_eigenpairs(matrix, 3)
    np.testing.assert_array_equal(matrix, before)


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_entry_that_is_not_finite_is_refused(bad):
    matrix = symmetric(4)
    matrix[2, 1] = bad
    with pytest.raises(LinAlgError, match="not finite"):
        lowest_eigenpairs(matrix, 2)


@pytest.mark.parametrize("transposed", [False, True])
def test_solutions_in_panels_are_those_at_once(transposed):
    matrix = symmetric(60)
    factor = np.linalg.cholesky(matrix @ matrix.T + 60 * np.eye(60, dtype=np.float32))
    right = np.random.default_rng(0).standard_normal((60, 2 * SOLVE_COLUMNS + 3)).astype(np.float32)
    expected = solve_triangular(factor, right, lower=True, trans=int(transposed))
    np.testing.assert_allclose(solve_lower_triangular(factor, right, transposed), expected, atol=1e-5)
