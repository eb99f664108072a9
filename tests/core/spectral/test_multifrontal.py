import numpy as np
import pytest
from scipy.sparse import csr_matrix, diags
from shapes import creature, grid, icosphere, together

from wks_segment.core import stiffness_matrix
from wks_segment.core.spectral.multifrontal import MultifrontalFactor, SingularError

MESHES = [icosphere(4), grid(40, 30), creature(0.5, 4), together(icosphere(2), grid(9, 9)), icosphere(1)]
COARSER = [icosphere(3), grid(30, 20), creature(0.5, 3), *MESHES[3:]]
"""For comparison with a dense solver, whose time grows with the cube of the number of vertices."""
IDS = ["sphere", "rectangle", "creature", "two islands", "smaller than a leaf"]


def shifted(mesh, shift):
    return csr_matrix(stiffness_matrix(mesh) + shift * diags(mesh.vertex_areas / mesh.area))


@pytest.mark.parametrize("mesh", MESHES, ids=IDS)
@pytest.mark.parametrize(("dtype", "tolerance"), [(np.float64, 1e-11), (np.float32, 1e-3)])
def test_solutions_of_a_positive_definite_matrix(mesh, dtype, tolerance):
    matrix = shifted(mesh, 100.0)
    right = np.random.default_rng(0).standard_normal((mesh.n_vertices, 7))
    solution = MultifrontalFactor(matrix, mesh.vertices, dtype).solve(right)
    assert solution.dtype == dtype
    np.testing.assert_allclose(matrix @ solution, right, atol=tolerance)


@pytest.mark.parametrize("mesh", COARSER, ids=IDS)
def test_an_indefinite_matrix_is_solved_and_its_negative_eigenvalues_are_counted(mesh):
    right = np.random.default_rng(0).standard_normal((mesh.n_vertices, 7))
    for shift in (-50.0, -600.0):
        matrix = shifted(mesh, shift)
        factor = MultifrontalFactor(matrix, mesh.vertices, np.float64)
        assert factor.n_negative == (np.linalg.eigvalsh(matrix.toarray()) < 0).sum() > 0
        np.testing.assert_allclose(matrix @ factor.solve(right), right, atol=1e-8)


def test_a_positive_definite_matrix_has_no_negative_eigenvalue():
    mesh = creature(0.5, 4)
    assert MultifrontalFactor(shifted(mesh, 100.0), mesh.vertices).n_negative == 0


def test_a_singular_matrix_is_an_error():
    with pytest.raises(SingularError, match="no inverse"):
        MultifrontalFactor(csr_matrix((5, 5)), np.zeros((5, 3)))


def test_unknowns_may_all_have_the_same_position():
    mesh = icosphere(3)
    matrix = shifted(mesh, 100.0)
    solution = MultifrontalFactor(matrix, np.zeros((mesh.n_vertices, 3)), np.float64).solve(np.eye(mesh.n_vertices))
    np.testing.assert_allclose(matrix @ solution, np.eye(mesh.n_vertices), atol=1e-9)


@pytest.mark.parametrize("mesh", MESHES, ids=IDS)
@pytest.mark.parametrize(("dtype", "tolerance"), [(np.float64, 1e-11), (np.float32, 1e-4)])
@pytest.mark.parametrize("width", [3, 200], ids=["narrow columns", "wide columns"])
def test_the_inverse_is_compressed_to_sparse_columns(mesh, dtype, tolerance, width):
    factor = MultifrontalFactor(shifted(mesh, 100.0), mesh.vertices, dtype)
    row = np.arange(mesh.n_vertices)
    right = csr_matrix((np.cos(row), (row, row // width)))
    compressed = factor.compressed(right)
    assert compressed.dtype == dtype
    expected = right.T @ factor.solve(right.toarray())
    np.testing.assert_allclose(compressed, expected, atol=tolerance * np.abs(expected).max())
