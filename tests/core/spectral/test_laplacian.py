import numpy as np
import pytest
from shapes import creature, grid, icosphere

from wks_segment.core import TriangleMesh, mass_matrix, stiffness_matrix

MESHES = [icosphere(2), grid(5, 4, 2.0), creature(0.5, 2)]


@pytest.mark.parametrize("mesh", MESHES, ids=["sphere", "rectangle", "creature"])
def test_stiffness_has_constants_in_its_null_space(mesh):
    stiffness = stiffness_matrix(mesh)
    np.testing.assert_allclose(stiffness @ np.ones(mesh.n_vertices), 0, atol=1e-12)
    assert abs(stiffness - stiffness.T).max() < 1e-13
    assert np.linalg.eigvalsh(stiffness.toarray()).min() > -1e-12


def test_stiffness_of_one_triangle_by_hand():
    # The edge opposite to the right angle at vertex 0 has the weight 0.
    mesh = TriangleMesh([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)])
    expected = [[1.0, -0.5, -0.5], [-0.5, 0.5, 0.0], [-0.5, 0.0, 0.5]]
    np.testing.assert_allclose(stiffness_matrix(mesh).toarray(), expected, atol=1e-15)


def test_energy_of_a_linear_function_is_its_slope_squared_times_area():
    mesh = grid(6, 5, 2.0, 1.5)
    x = mesh.vertices[:, 0]
    assert x @ stiffness_matrix(mesh) @ x == pytest.approx(3.0)


@pytest.mark.parametrize("lumped", [True, False])
@pytest.mark.parametrize("mesh", MESHES, ids=["sphere", "rectangle", "creature"])
def test_mass_sums_to_the_area(mesh, lumped):
    mass = mass_matrix(mesh, lumped)
    assert mass.sum() == pytest.approx(mesh.area)
    assert (mass.diagonal() > 0).all()


def test_consistent_mass_integrates_products_of_linear_functions():
    mesh = grid(4, 4)
    x = mesh.vertices[:, 0]
    assert x @ mass_matrix(mesh, lumped=False) @ x == pytest.approx(1 / 3)


def test_a_face_without_area_gives_finite_weights():
    mesh = TriangleMesh([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0.5, 0, 0)], [(0, 1, 2), (0, 3, 1)])
    stiffness = stiffness_matrix(mesh)
    assert np.isfinite(stiffness.data).all()
    assert abs(stiffness @ np.ones(4)).max() < 1e-6
