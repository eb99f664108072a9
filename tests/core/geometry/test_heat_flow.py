import numpy as np
from shapes import grid

from wks_segment.core import TriangleMesh, prepare_surface, stiffness_matrix
from wks_segment.core.geometry.heat_flow import HeatFlow
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
