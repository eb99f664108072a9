import numpy as np
import pytest
from scipy.sparse import csr_matrix
from shapes import creature, grid, icosphere, together

from wks_segment.core import TriangleMesh, stiffness_matrix
from wks_segment.core.mesh.triangle_mesh import connected_groups
from wks_segment.core.spectral.coarsening import HEAVIEST_CELL, Level, cluster_vertices, coarse_eigenpairs, graph_edges


def unit_area(mesh):
    return TriangleMesh(mesh.vertices / np.sqrt(mesh.area), mesh.faces)


def cells_of(mesh, n_cells):
    edges = graph_edges(csr_matrix(stiffness_matrix(mesh)))
    return (*cluster_vertices(mesh.vertices, edges, mesh.vertex_areas, n_cells), edges)


@pytest.mark.parametrize("mesh", [icosphere(4), creature(0.4), grid(50, 40)], ids=["sphere", "limbs", "rectangle"])
def test_cells_are_connected_not_too_heavy_and_as_many_as_asked_for(mesh):
    mesh = unit_area(mesh)
    cell, count, (a, b) = cells_of(mesh, 200)
    assert 150 < count < 600
    mass = np.bincount(cell, weights=mesh.vertex_areas)
    assert mass.max() <= HEAVIEST_CELL / 200 + mesh.vertex_areas.max()
    inside = cell[a] == cell[b]
    assert connected_groups(np.stack([a[inside], b[inside]], axis=1), mesh.n_vertices).max() + 1 == count


def test_cells_do_not_span_two_nearby_sheets():
    lower, upper = grid(30, 30), grid(30, 30)
    mesh = unit_area(together(lower, TriangleMesh(upper.vertices + (0, 0, 1e-3), upper.faces)))
    cell, _, _ = cells_of(mesh, 100)
    assert not set(cell[: lower.n_vertices]) & set(cell[lower.n_vertices :])


@pytest.mark.parametrize("wide", [False, True])
def test_prolongation_reproduces_constants_and_linear_functions_inside_a_plane(wide):
    mesh = unit_area(grid(60, 60))
    prolongation, cells = Level.of(mesh).coarsened(150, wide)
    np.testing.assert_allclose(prolongation @ np.ones(prolongation.shape[1]), 1.0, atol=1e-5)
    inside = (np.abs(mesh.vertices[:, :2] - mesh.vertices[:, :2].mean(axis=0)) < 0.3).all(axis=1)
    for axis in range(2):
        linear = prolongation @ cells.positions[:, axis]
        np.testing.assert_allclose(linear[inside], mesh.vertices[inside, axis], atol=2e-3)


def test_prolongation_does_not_depend_on_the_orientation_of_faces():
    mesh = unit_area(creature(0.4))
    turned = mesh.faces.copy()
    turned[::2] = turned[::2, ::-1]
    one, other = (Level.of(m).coarsened(300)[0] for m in (mesh, TriangleMesh(mesh.vertices, turned)))
    np.testing.assert_allclose(one.toarray(), other.toarray(), atol=1e-5)


def test_a_level_of_cells_has_the_area_and_nearly_the_energy_of_the_surface():
    mesh = unit_area(creature(0.4, 5))
    level = Level.of(mesh)
    prolongation, cells = level.coarsened(2000)
    assert cells.areas.sum() == pytest.approx(1)
    assert cells.mass.sum() == pytest.approx(1, rel=1e-5)
    for axis in range(3):
        on_surface, on_cells = mesh.vertices[:, axis], cells.positions[:, axis]
        assert on_cells @ cells.stiffness @ on_cells == pytest.approx(
            on_surface @ level.stiffness @ on_surface, rel=0.03
        )
        difference = prolongation @ on_cells - on_surface
        assert difference @ level.stiffness @ difference < 0.03 * (on_surface @ level.stiffness @ on_surface)


def test_coarse_eigenvalues_are_close_upper_bounds():
    mesh = unit_area(icosphere(5))
    _, cells = Level.of(mesh).coarsened(400, wide=True)
    values, vectors = coarse_eigenpairs(cells, 1, 24)
    expected = 4 * np.pi * np.repeat([2, 6, 12, 20], [3, 5, 7, 9])
    np.testing.assert_allclose(values, expected, rtol=0.02)
    assert (values > 0.998 * expected).all()
    np.testing.assert_allclose(vectors.T @ (cells.mass @ vectors), np.eye(24), atol=1e-4)


def test_a_tiny_surface_can_be_coarsened():
    prolongation, _ = Level.of(unit_area(icosphere(0))).coarsened(4)
    np.testing.assert_allclose(prolongation @ np.ones(prolongation.shape[1]), 1.0, atol=1e-5)
