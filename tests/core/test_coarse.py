import numpy as np
import pytest
from scipy.sparse import csr_matrix
from shapes import creature, grid, icosphere, together

from wks_segment.core import TriangleMesh, stiffness_matrix
from wks_segment.core.coarse import HEAVIEST, cluster, edges_of, prolongation


def unit_area(mesh):
    return TriangleMesh(mesh.vertices / np.sqrt(mesh.area), mesh.faces)


def cells_of(mesh, n_cells):
    edges = edges_of(csr_matrix(stiffness_matrix(mesh)))
    return (*cluster(mesh.vertices, edges, mesh.vertex_areas, n_cells), edges)


@pytest.mark.parametrize("mesh", [icosphere(4), creature(0.4), grid(50, 40)], ids=["sphere", "limbs", "rectangle"])
def test_cells_are_many_enough_connected_and_not_heavy(mesh):
    mesh = unit_area(mesh)
    cell, count, (a, b) = cells_of(mesh, 200)
    assert 150 < count < 600
    mass = np.bincount(cell, weights=mesh.vertex_areas)
    assert mass.max() <= HEAVIEST / 200 + mesh.vertex_areas.max()
    inside = cell[a] == cell[b]
    from wks_segment.core.coarse import _components

    assert _components(a[inside], b[inside], mesh.n_vertices)[1] == count


def test_sheets_that_lie_close_have_cells_of_their_own():
    lower, upper = grid(30, 30), grid(30, 30)
    mesh = unit_area(together(lower, TriangleMesh(upper.vertices + (0, 0, 1e-3), upper.faces)))
    cell, _, _ = cells_of(mesh, 100)
    assert not set(cell[: lower.n_vertices]) & set(cell[lower.n_vertices :])


def test_prolongation_carries_constants_everywhere_and_slopes_on_a_plane():
    mesh = unit_area(grid(60, 60))
    stiffness = csr_matrix(stiffness_matrix(mesh))
    basis = prolongation(mesh, mesh.vertex_areas, stiffness, 150)
    np.testing.assert_allclose(basis @ np.ones(basis.shape[1]), 1.0, atol=1e-9)
    # The best fit of a slope from the coarse space, inside: the border's Jacobi step bends it.
    slope = mesh.vertices[:, 0]
    fit = basis @ np.linalg.lstsq(basis.toarray(), slope, rcond=None)[0]
    assert np.abs(fit - slope).max() < 0.03


def test_a_tiny_surface_still_works():
    mesh = unit_area(icosphere(0))
    basis = prolongation(mesh, mesh.vertex_areas, csr_matrix(stiffness_matrix(mesh)), 4)
    np.testing.assert_allclose(basis @ np.ones(basis.shape[1]), 1.0, atol=1e-9)
