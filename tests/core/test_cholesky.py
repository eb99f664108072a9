import numpy as np
import pytest
from scipy.sparse import csr_matrix, diags
from shapes import creature, grid, icosphere, together

from wks_segment.core import stiffness_matrix
from wks_segment.core.cholesky import NestedDissectionCholesky, NotPositiveDefiniteError, eigenvalues_below_zero

MESHES = [icosphere(4), grid(40, 30), creature(0.5, 4), together(icosphere(2), grid(9, 9)), icosphere(1)]
IDS = ["sphere", "rectangle", "creature", "two parts", "smaller than a leaf"]


def shifted(mesh, shift):
    return csr_matrix(stiffness_matrix(mesh) + shift * diags(mesh.vertex_areas / mesh.area))


@pytest.mark.parametrize("mesh", MESHES, ids=IDS)
@pytest.mark.parametrize(("dtype", "tolerance"), [(np.float64, 1e-11), (np.float32, 1e-3)])
def test_it_solves(mesh, dtype, tolerance):
    matrix = shifted(mesh, 100.0)
    right = np.random.default_rng(0).standard_normal((mesh.n_vertices, 7))
    solution = NestedDissectionCholesky(matrix, mesh.vertices, dtype).solve(right)
    assert solution.dtype == dtype
    np.testing.assert_allclose(matrix @ solution, right, atol=tolerance)


@pytest.mark.parametrize("mesh", MESHES, ids=IDS)
def test_inertia_is_the_number_of_negative_eigenvalues(mesh):
    for shift in (-50.0, -600.0):
        matrix = shifted(mesh, shift)
        expected = (np.linalg.eigvalsh(matrix.toarray()) < 0).sum()
        assert eigenvalues_below_zero(matrix, mesh.vertices) == expected > 0


def test_a_matrix_that_is_not_positive_definite_is_refused():
    with pytest.raises(NotPositiveDefiniteError, match="pivot"):
        NestedDissectionCholesky(shifted(icosphere(3), -100.0), icosphere(3).vertices)


def test_points_at_one_place_do_not_matter():
    mesh = icosphere(3)
    matrix = shifted(mesh, 100.0)
    solution = NestedDissectionCholesky(matrix, np.zeros((mesh.n_vertices, 3)), np.float64).solve(
        np.eye(mesh.n_vertices)
    )
    np.testing.assert_allclose(matrix @ solution, np.eye(mesh.n_vertices), atol=1e-9)
