import numpy as np
import pytest
from scipy.linalg import eigh
from shapes import creature, icosphere, together

from wks_segment.core import TriangleMesh, eigenpairs
from wks_segment.core.progress import Progress
from wks_segment.core.spectral.coarsening import Level
from wks_segment.core.spectral.smooth_space import ShiftedOperator, smooth_eigenpairs


def level_of(mesh):
    return Level.of(TriangleMesh(mesh.vertices / np.sqrt(mesh.area), mesh.faces))


def thinned(mesh):
    return TriangleMesh(mesh.vertices * (1, 1, 0.02), mesh.faces)


@pytest.mark.parametrize("mesh", [creature(0.4), thinned(creature(0.4))], ids=["limbs", "two sheets that almost touch"])
def test_first_values_are_close_to_the_exact_ones(mesh):
    expected = eigenpairs(mesh, 81, "exact")[0][1:]
    values, _, _ = smooth_eigenpairs(ShiftedOperator(level_of(mesh), 40.0), 260, 80, Progress())
    # Mostly 0.1 %; one value of the sheets is 7 % off on some processors, which corrections mend.
    np.testing.assert_allclose(values, expected, rtol=0.1)


def test_pairs_are_those_of_galerkin_in_the_space_that_is_never_computed():
    level, shift, count = level_of(creature(0.4, 3)), 20.0, 30
    operator = ShiftedOperator(level, shift)
    values, sources, weights = smooth_eigenpairs(operator, 120, count, Progress())
    space = operator.factor.solve(sources.toarray()).astype(np.float64)
    expected = eigh(space.T @ (level.stiffness @ space), space.T @ (level.mass @ space), eigvals_only=True)
    np.testing.assert_allclose(values, expected[1 : count + 1], rtol=5e-3)
    functions = space @ weights
    np.testing.assert_allclose(functions.T @ (level.mass @ functions), np.eye(count), atol=0.03)


def test_zero_modes_of_islands_are_left_out():
    one = icosphere(3)
    level = level_of(together(*(TriangleMesh(one.vertices + 5 * i, one.faces) for i in range(5))))
    values, _, _ = smooth_eigenpairs(ShiftedOperator(level, 10.0), 150, 15, Progress())
    np.testing.assert_allclose(values, 5 * 8 * np.pi, rtol=0.01)


def test_there_are_no_more_pairs_than_the_space_has():
    values, _, weights = smooth_eigenpairs(ShiftedOperator(level_of(icosphere(2)), 10.0), 20, 1000, Progress())
    assert len(values) == weights.shape[1] == weights.shape[0] - 1
