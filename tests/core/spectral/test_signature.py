import numpy as np
import pytest
from shapes import creature, grid, icosphere, together

from wks_segment.core import TriangleMesh, eigenpairs, heat_kernel_signature, wave_kernel_signature


def exact(mesh, n_pairs):
    return eigenpairs(mesh, n_pairs, accuracy="exact")


def wks_by_hand(values, functions, n_energies):
    """The paper's formula, written as loops."""
    values = list(values[1:])
    first, last = np.log(values[0]), np.log(values[-1]) / 1.02
    sigma = 7 * (last - first) / n_energies
    result = np.zeros((len(functions), n_energies))
    for column in range(n_energies):
        energy = first + (last - first) * column / (n_energies - 1)
        for vertex in range(len(functions)):
            top = bottom = 0.0
            for k, value in enumerate(values):
                weight = np.exp(-((energy - np.log(value)) ** 2) / (2 * sigma**2))
                top += weight * functions[vertex, k + 1] ** 2
                bottom += weight
            result[vertex, column] = top / bottom
    return result


def test_wks_is_the_papers_formula():
    values, functions = eigenpairs(grid(4, 3, 2.0), 12)
    np.testing.assert_allclose(
        wave_kernel_signature(values, functions, 9), wks_by_hand(values, functions, 9), rtol=1e-10
    )


def test_hks_is_the_heat_that_remains_at_a_vertex():
    mesh = grid(4, 3, 2.0)
    values, functions = eigenpairs(mesh, mesh.n_vertices)
    times = [0.01, 0.1]
    expected = [
        [sum(np.exp(-v * t) * f**2 for v, f in zip(values, row, strict=True)) for t in times] for row in functions
    ]
    np.testing.assert_allclose(heat_kernel_signature(values, functions, times=times), expected)


def test_mean_over_the_surface_is_one_at_every_energy():
    mesh = creature(0.5)
    signature = wave_kernel_signature(*exact(mesh, 60))
    np.testing.assert_allclose(mesh.vertex_areas @ signature / mesh.area, 1.0, rtol=1e-8)


def moved(mesh, seed=3):
    generator = np.random.default_rng(seed)
    rotation = np.linalg.qr(generator.standard_normal((3, 3)))[0]
    return TriangleMesh(2.7e3 * mesh.vertices @ rotation.T + [5e3, -2e3, 1e2], mesh.faces)


def test_fast_pairs_give_nearly_the_same_signature():
    for mesh in (creature(0.5), moved(creature(0.5))):
        fast, reference = (wave_kernel_signature(*eigenpairs(mesh, 150, accuracy=a)) for a in ("fast", "exact"))
        assert fast.dtype == np.float32
        assert np.linalg.norm(fast - reference) < 0.007 * np.linalg.norm(reference)


def test_fast_pairs_of_very_thin_triangles_give_nearly_the_same_signature():
    mesh = creature(0.3)
    vertices = mesh.vertices.copy()
    ends = mesh.faces[::40, :2]
    vertices[ends[:, 0]] = vertices[ends[:, 1]] + 1e-5 * (vertices[ends[:, 0]] - vertices[ends[:, 1]])
    thin = TriangleMesh(vertices, mesh.faces)
    values, functions = eigenpairs(thin, 150, accuracy="fast")
    assert (np.diff(values) >= 0).all()
    fast, reference = wave_kernel_signature(values, functions), wave_kernel_signature(*exact(thin, 150))
    assert np.linalg.norm(fast - reference) < 0.007 * np.linalg.norm(reference)


@pytest.mark.parametrize("kind", [wave_kernel_signature, heat_kernel_signature])
def test_rotation_translation_and_scale_change_nothing(kind):
    mesh = creature(0.5, 3)
    np.testing.assert_allclose(kind(*exact(moved(mesh), 60)), kind(*exact(mesh, 60)), rtol=1e-6)


def test_the_order_of_vertices_changes_nothing():
    mesh = creature(0.5, 3)
    order = np.random.default_rng(1).permutation(mesh.n_vertices)
    shuffled = TriangleMesh(mesh.vertices[order], np.argsort(order)[mesh.faces])
    signature = wave_kernel_signature(*exact(mesh, 60))
    np.testing.assert_allclose(wave_kernel_signature(*exact(shuffled, 60)), signature[order], rtol=1e-6)


def test_signatures_differ_less_between_poses_than_between_vertices():
    a, b = (wave_kernel_signature(*eigenpairs(creature(bend, 3), 60)) for bend in (0.0, 0.8))
    between_poses = np.abs(np.log(a) - np.log(b)).mean()
    between_vertices = np.abs(np.log(a) - np.log(np.roll(a, len(a) // 2, axis=0))).mean()
    assert between_poses < between_vertices / 3


def test_all_zero_modes_are_left_out():
    both = together(icosphere(2), TriangleMesh(icosphere(2).vertices + 5, icosphere(2).faces))
    signature = wave_kernel_signature(*eigenpairs(both, 32))
    assert np.isfinite(signature).all()
    np.testing.assert_allclose(signature[: len(signature) // 2].mean(axis=0), 1.0, atol=0.05)


def test_blocks_of_rows_change_nothing(monkeypatch):
    from wks_segment.core.spectral import signature as module

    pairs = exact(creature(0.1, 3), 40)
    whole = wave_kernel_signature(*pairs)
    monkeypatch.setattr(module, "SIGNATURE_ROWS", 7)
    np.testing.assert_allclose(wave_kernel_signature(*pairs), whole, rtol=1e-12)


@pytest.mark.parametrize(
    ("values", "functions", "message"),
    [
        ([0.0, 1.0, 2.0], np.ones((5, 2)), "values must have the shape"),
        ([0.0, 0.0, 3.0], np.ones((5, 3)), "two eigenvalues above zero"),
        ([0.0, 5.0, 3.0], np.ones((5, 3)), "must rise"),
        ([0.0, 3.0, 3.0], np.ones((5, 3)), "span no energies"),
    ],
)
def test_unusable_pairs_are_an_error(values, functions, message):
    with pytest.raises(ValueError, match=message):
        wave_kernel_signature(values, functions)
