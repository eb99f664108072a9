import numpy as np
import pytest
from shapes import creature, grid, shaken

from wks_segment.core import TriangleMesh, prepare_surface, stiffness_matrix
from wks_segment.core.geometry.heat_flow import Flows, HeatFlow
from wks_segment.core.spectral.laplacian import unit_area_masses


def test_smoothing_preserves_sums_and_does_not_depend_on_the_meshing():
    results = []
    for n in (30, 60):
        mesh = grid(n, n)
        hard = (mesh.vertices[:, 0] > 0.5).astype(float)
        smooth = HeatFlow(mesh, 0.1).smooth(np.stack([hard, 1 - hard], axis=1))
        np.testing.assert_allclose(smooth.sum(axis=1), 1.0, atol=1e-5)
        results.append(np.interp(np.linspace(0, 1, 11), mesh.vertices[:: n + 1, 0], smooth[:: n + 1, 0]))
    np.testing.assert_allclose(results[0], results[1], atol=0.06)


def test_needles_are_smoothed_in_double_precision():
    random = np.random.default_rng(0)
    vertices = random.standard_normal((60, 3))
    faces = np.array([random.choice(60, 3, replace=False) for _ in range(150)])
    for a, b, c in faces[random.random(150) < 0.5]:
        vertices[c] = (vertices[a] + vertices[b]) / 2 + 1e-7 * random.standard_normal(3)
    mesh = prepare_surface(TriangleMesh(vertices, faces), 450).mesh
    posteriors = random.dirichlet(np.ones(3), mesh.n_vertices)
    smooth = HeatFlow(mesh, 0.06).smooth(posteriors)
    np.testing.assert_allclose(smooth.sum(axis=1), 1, atol=1e-6)
    system = np.diag(unit_area_masses(mesh)) + 0.06**2 * stiffness_matrix(mesh).toarray()
    np.testing.assert_allclose(system @ smooth, unit_area_masses(mesh)[:, None] * posteriors, atol=1e-9)


@pytest.mark.parametrize("length", [0.01, 0.02, 0.05])
def test_a_short_flow_is_the_same_step(length):
    for mesh in (creature(0.3, 3), shaken(creature(0.3, 3)), grid(20, 30)):
        values = np.random.default_rng(0).standard_normal((mesh.n_vertices, 3)) * (1, 100, 1e-3)
        flows = Flows(mesh)
        expected, found = flows.over(length).smooth(values), flows.short(length).smooth(values)
        size = np.abs(values).max(axis=0)
        np.testing.assert_allclose(found / size, expected / size, atol=1e-3)


def test_a_short_flow_leaves_what_is_the_same_everywhere():
    mesh = shaken(creature(0.3, 3))
    values = np.tile([0.0, 2.5], (mesh.n_vertices, 1))
    np.testing.assert_allclose(Flows(mesh).short(0.02).smooth(values), values, atol=1e-9)
    # Also beside a function that takes many steps.
    noise = np.random.default_rng(0).standard_normal(mesh.n_vertices)
    beside = Flows(mesh).short(0.3).smooth(np.column_stack([values, noise]))
    np.testing.assert_allclose(beside[:, :2], values, atol=1e-9)
    assert beside[:, 2].std() < 0.5 * noise.std()


def test_a_short_flow_does_not_change_the_values_given():
    mesh = grid(8, 8)
    values = np.random.default_rng(0).standard_normal((mesh.n_vertices, 2))
    before = values.copy()
    Flows(mesh).short(0.1).smooth(values)
    np.testing.assert_array_equal(values, before)


def test_a_short_flow_is_finite_on_needles():
    random = np.random.default_rng(0)
    vertices = random.standard_normal((60, 3))
    faces = np.array([random.choice(60, 3, replace=False) for _ in range(150)])
    for a, b, c in faces[random.random(150) < 0.5]:
        vertices[c] = (vertices[a] + vertices[b]) / 2 + 1e-7 * random.standard_normal(3)
    mesh = prepare_surface(TriangleMesh(vertices, faces), 450).mesh
    normals = random.standard_normal((mesh.n_vertices, 3))
    smooth = Flows(mesh).short(0.02).smooth(normals)
    assert np.isfinite(smooth).all()
    assert np.abs(smooth).max() < 10 * np.abs(normals).max()
