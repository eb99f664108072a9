import functools

import numpy as np
import pytest
from shapes import creature, grid, icosphere, shaken, together

from wks_segment.core import TriangleMesh, eigenpairs, mass_matrix, stiffness_matrix
from wks_segment.core.spectral import eigenpairs as module
from wks_segment.core.spectral import lanczos, multifrontal, multilevel
from wks_segment.core.spectral.coarsening import Level
from wks_segment.core.spectral.memory import available_memory


@pytest.mark.parametrize("accuracy", ["fast", "exact"])
def test_eigenvalues_of_the_sphere(accuracy):
    # k (k + 1) on the unit sphere, 2 k + 1 times each; times 4 π on the sphere of area 1.
    values, _ = eigenpairs(icosphere(5), 49, accuracy)
    expected = np.concatenate([[k * (k + 1)] * (2 * k + 1) for k in range(7)]) * 4 * np.pi
    np.testing.assert_allclose(values, expected, rtol=0.005, atol=1e-9)


@pytest.mark.parametrize("accuracy", ["fast", "exact"])
def test_eigenvalues_of_the_rectangle_with_free_border(accuracy):
    # π² (i² / a² + j² / b²) with Neumann's condition, on a × b = 1.
    a, b = 1.25, 0.8
    values, _ = eigenpairs(grid(50, 32, a, b), 20, accuracy)
    i, j = np.meshgrid(np.arange(12), np.arange(12))
    expected = np.sort((np.pi**2 * (i**2 / a**2 + j**2 / b**2)).ravel())[:20]
    np.testing.assert_allclose(values, expected, rtol=0.01, atol=1e-9)


@pytest.mark.parametrize("n_pairs", [1, 40, 300])
def test_pairs_solve_the_problem_and_are_orthonormal(n_pairs):
    mesh = creature(0.4)
    values, functions = eigenpairs(mesh, n_pairs, accuracy="exact")
    mass = mass_matrix(mesh) / mesh.area
    np.testing.assert_allclose(functions.T @ mass @ functions, np.eye(n_pairs), atol=1e-8)
    residual = stiffness_matrix(mesh) @ functions - mass @ functions * values
    # In the norm of M⁻¹, relative to the eigenvalue; for the zero mode relative to 1.
    size = np.sqrt((residual**2 / mass.diagonal()[:, None]).sum(axis=0))
    assert (size / np.maximum(values, 1)).max() < 1e-8
    assert (np.diff(values) >= 0).all()


def test_iterative_and_dense_solver_agree(monkeypatch):
    mesh = creature(0.3, 3)
    monkeypatch.setattr(module, "DENSE_BELOW", 10_000)
    dense, _ = eigenpairs(mesh, 100, "exact")
    monkeypatch.setattr(module, "DENSE_BELOW", 0)
    iterative, _ = eigenpairs(mesh, 100, "exact")
    np.testing.assert_allclose(iterative, dense, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(("accuracy", "tolerance"), [("exact", 1e-8), ("fast", 5e-3)])
def test_equal_islands_have_equal_eigenvalues(monkeypatch, accuracy, tolerance):
    monkeypatch.setattr(module, "DENSE_BELOW", 0)
    one = creature(0.2, 3)
    apart = [TriangleMesh(one.vertices + 20 * i, one.faces) for i in range(4)]
    values, _ = eigenpairs(together(*apart), 80, accuracy)
    # On the scale of area 1, the eigenvalues of one of four islands are four times as large.
    single, _ = eigenpairs(one, 20, "exact")
    np.testing.assert_allclose(values, np.repeat(4 * single, 4), rtol=tolerance, atol=1e-8)


def dumbbell(radius):
    """Two spheres that a thin tube of very thin triangles joins: the first eigenvalue after the zero mode is near 0."""
    first, second = icosphere(4), icosphere(4)
    thread = radius * np.array([(0, 1, 0), (0, -0.5, 0.87), (0, -0.5, -0.87)])
    vertices = np.concatenate([first.vertices, second.vertices + (3, 0, 0), thread + (1, 0, 0), thread + (2, 0, 0)])
    n = first.n_vertices
    near, far = np.argmax(first.vertices[:, 0]), n + np.argmin(second.vertices[:, 0])
    a, b = 2 * n + np.arange(3), 2 * n + 3 + np.arange(3)
    tube = [t for i in range(3) for t in ((a[i], a[i - 1], b[i]), (b[i], a[i - 1], b[i - 1]))]
    ends = [(near, a[i], a[i - 1]) for i in range(3)] + [(far, b[i], b[i - 1]) for i in range(3)]
    return TriangleMesh(vertices, np.concatenate([first.faces, n + second.faces, tube, ends]))


@pytest.mark.parametrize("radius", [0.05, 0.002, 1e-4])
@pytest.mark.parametrize("n_pairs", [40, 150])
def test_spheres_joined_by_a_thin_tube_are_solved_exactly(radius, n_pairs):
    mesh = dumbbell(radius)
    values, functions = eigenpairs(mesh, n_pairs, "exact")
    assert values[0] == 0
    assert 0 < values[1] < 1
    mass = mass_matrix(mesh) / mesh.area
    np.testing.assert_allclose(functions.T @ mass @ functions, np.eye(n_pairs), atol=1e-8)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("radius", [0.05, 0.002, 1e-4])
@pytest.mark.parametrize("n_pairs", [40, 300])
def test_the_fast_solver_needs_no_other_for_a_value_near_zero(radius, n_pairs):
    # Single precision does not suffice for the value, nor, with the thinnest tube and many pairs, for the factor.
    mesh = dumbbell(radius)
    assert eigenpairs(mesh, n_pairs, "fast")[0][1] == pytest.approx(eigenpairs(mesh, n_pairs, "exact")[0][1], rel=1e-3)


def test_low_values_of_a_long_ribbon_are_as_accurate_as_high_ones():
    mesh = grid(1000, 2, 10, 0.02)
    values, expected = (eigenpairs(mesh, 60, accuracy)[0] for accuracy in ("fast", "exact"))
    np.testing.assert_allclose(values[1:20], expected[1:20], rtol=5e-3)


def test_polishing_removes_errors_just_above_the_known_pairs():
    mesh = creature(0.3, 3)
    known = 40
    problem = module._Problem.of(mesh)
    operator, zero_modes = problem.operator(), problem.zero_modes()
    values, vectors = module._solve_densely(operator, zero_modes, 60)
    factor = lanczos._factor(operator, Level.of(problem.mesh), lanczos.SHIFT_WITHIN * values[known])
    error = vectors[:, known:] @ np.random.default_rng(0).standard_normal((60 - known, known))
    wrong_values, wrong = values[:known].copy(), np.linalg.qr(vectors[:, :known] + 1e-9 * error)[0]
    assert (lanczos._residuals(operator, wrong_values, wrong) > lanczos.EXACT_TOLERANCE).any()
    lanczos._polish(operator, factor, lanczos.SHIFT_WITHIN * values[known], zero_modes, wrong_values, wrong)
    lanczos.check_eigenpairs(operator, wrong_values, wrong)


def test_each_island_has_a_zero_mode():
    values, functions = eigenpairs(together(icosphere(2), grid(6, 6)), 10)
    assert (values[:2] == 0).all()
    assert values[2] > 1
    for k in range(2):
        assert len(np.unique(functions[:, k].round(12))) == 2


def test_missed_pairs_are_found(monkeypatch):
    # Lanczos can miss pairs of clusters; the inertia count must notice that, and the repair must find them.
    monkeypatch.setattr(module, "DENSE_BELOW", 0)
    mesh = creature(0.3, 3)
    expected, _ = eigenpairs(mesh, 50, "exact")
    real, calls = lanczos._block_lanczos, []

    def forgetful(factor, shift, known, start, count, progress):
        calls.append(count)
        if len(calls) > 1:
            return real(factor, shift, known, start, count, progress)
        return tuple(
            np.delete(found, [3, 25, 26], axis=-1) for found in real(factor, shift, known, start, count + 3, progress)
        )

    monkeypatch.setattr(lanczos, "_block_lanczos", forgetful)
    values, _ = eigenpairs(mesh, 50, "exact")
    assert calls == [50, 3]
    np.testing.assert_allclose(values, expected, rtol=1e-9, atol=1e-9)


def test_inaccurate_pairs_are_an_error(monkeypatch):
    monkeypatch.setattr(module, "DENSE_BELOW", 0)
    monkeypatch.setattr(lanczos, "EXACT_TOLERANCE", 1e-20)
    monkeypatch.setattr(lanczos, "ROUNDING", 0.0)
    with pytest.raises(module.SpectrumError, match="not accurate enough: relative residual"):
        eigenpairs(creature(0.3, 3), 20, "exact")


def test_fast_falls_back_to_exact_with_a_warning(monkeypatch):
    mesh = creature(0.3, 4)
    monkeypatch.setattr(multilevel, "LARGEST_CHANGE", 0.0)
    monkeypatch.setattr(multilevel, "LARGEST_LATER_CHANGE", 0.0)
    with pytest.warns(UserWarning, match="fast eigensolver did not converge"):
        values, _ = eigenpairs(mesh, 60, "fast")
    np.testing.assert_allclose(values, eigenpairs(mesh, 60, "exact")[0], rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"n_pairs": 0}, "n_pairs must be at least 1"),
        ({"accuracy": "rough"}, "accuracy must be one of"),
    ],
)
def test_an_error_names_the_parameter(change, message):
    with pytest.raises(ValueError, match=message):
        eigenpairs(icosphere(2), **{"n_pairs": 10, **change})


def test_an_error_names_a_vertex_without_a_face():
    mesh = grid(3, 3)
    with pytest.raises(ValueError, match="vertex 16 belongs to no face"):
        eigenpairs(TriangleMesh(np.concatenate([mesh.vertices, [(5, 5, 5)]]), mesh.faces), 5)


def test_a_mesh_with_fewer_vertices_than_pairs_has_fewer_pairs_with_a_warning():
    with pytest.warns(UserWarning, match="only 12 vertices"):
        values, functions = eigenpairs(icosphere(0), 300)
    assert values.shape == (12,)
    assert functions.shape == (12, 12)


def test_too_little_memory_is_an_error_before_the_solve(monkeypatch):
    monkeypatch.setattr(module, "available_memory", lambda: 10_000_000)
    with pytest.raises(
        MemoryError, match=r"60 eigenpairs of 10,242 vertices .fast. need about 36 MB .* only 10 MB are free"
    ):
        eigenpairs(icosphere(5), 60)


IRREGULAR = {
    "limbs": creature(0.4, 5),
    "irregular": shaken(creature(0.4, 5)),
    "islands": together(creature(0.2, 4), grid(60, 40)),
}


@functools.cache
def exact_pairs_of(name):
    return eigenpairs(IRREGULAR[name], 80, "exact")


@pytest.mark.parametrize("name", IRREGULAR)
@pytest.mark.parametrize("path", ["one level", "cells between", "cells between, corrected"])
def test_fast_pairs_agree_with_exact_ones(monkeypatch, name, path):
    mesh = IRREGULAR[name]
    if path != "one level":
        monkeypatch.setattr(multilevel, "CELL_LEVEL_ABOVE", 0)
        monkeypatch.setattr(multilevel, "MIDDLE_CELLS_PER_PAIR", 30)
    if path == "cells between, corrected":
        monkeypatch.setattr(multilevel, "LARGEST_UNCORRECTED_CHANGE", 0.0)
    expected, functions = exact_pairs_of(name)
    values, approximate = eigenpairs(mesh, 80, "fast")
    np.testing.assert_allclose(values, expected, rtol=0.03 if path == "cells between" else 0.012, atol=1e-8)
    mass = mass_matrix(mesh) / mesh.area
    covered = np.linalg.norm(functions.T @ mass @ approximate, axis=0)
    # Except the last ones, which may be mixed with the first ones that were not asked for.
    np.testing.assert_allclose(covered[:70], 1, atol=0.02)


@pytest.mark.parametrize("accuracy", ["fast", "exact"])
def test_progress_rises_and_an_error_from_it_ends_the_solve(accuracy):
    shares = []
    eigenpairs(creature(0.3, 4), 60, accuracy, shares.append)
    assert len(shares) >= 3
    assert shares == sorted(shares)
    assert 0 <= shares[0] <= shares[-1] <= 1

    refused = []

    def stop(share):
        if share > 0.15:
            refused.append(share)
            raise ValueError("enough")

    with pytest.raises(ValueError, match="enough"):
        eigenpairs(creature(0.3, 4), 60, accuracy, stop)
    assert len(refused) == 1  # not taken for an error of the fast solver, after which the exact one would start


@pytest.mark.parametrize("accuracy", ["fast", "exact"])
def test_the_order_of_the_vertices_does_not_matter(accuracy):
    mesh = creature(0.3, 4)
    order = np.random.default_rng(0).permutation(mesh.n_vertices)
    place = np.argsort(order)
    values, functions = eigenpairs(mesh, 60, accuracy)
    again, elsewhere = eigenpairs(TriangleMesh(mesh.vertices[order], place[mesh.faces]), 60, accuracy)
    np.testing.assert_allclose(again, values, rtol=1e-3, atol=1e-8)
    np.testing.assert_allclose((elsewhere**2).sum(axis=1), (functions**2)[order].sum(axis=1), rtol=0.05)


def test_available_memory_is_a_plausible_number_of_bytes():
    assert 2**20 < available_memory() < 2**50


def test_many_islands_have_all_pairs_that_were_asked_for(monkeypatch):
    one = creature(0.2, 2)
    mesh = together(*(TriangleMesh(one.vertices + 20 * i, one.faces) for i in range(40)))
    for n_pairs in (41, 80):
        values, functions = eigenpairs(mesh, n_pairs)
        assert values.shape == (n_pairs,)
        assert functions.shape == (mesh.n_vertices, n_pairs)
        assert (values[:40] == 0).all()
        np.testing.assert_allclose(values[40:], values[40], rtol=0.02)


def test_more_equal_eigenvalues_than_a_block_is_wide_are_all_found():
    one = icosphere(1)
    mesh = together(*(TriangleMesh(one.vertices + 20 * i, one.faces) for i in range(40)))
    values, _ = eigenpairs(mesh, 139, "exact")
    np.testing.assert_allclose(values[40:], values[-1], rtol=1e-6)


@pytest.fixture
def work(monkeypatch):
    """Counts of factorizations and of columns that were solved for."""
    counts = {"factors": 0, "columns": 0}
    factorize, solve = multifrontal.MultifrontalFactor.__init__, multifrontal.MultifrontalFactor.solve

    def factorized(self, *arguments):
        counts["factors"] += 1
        factorize(self, *arguments)

    def solved(self, right):
        counts["columns"] += right.shape[1]
        return solve(self, right)

    monkeypatch.setattr(multifrontal.MultifrontalFactor, "__init__", factorized)
    monkeypatch.setattr(multifrontal.MultifrontalFactor, "solve", solved)
    return counts


ISLAND = creature(0.2, 2)
SHAPES = {
    "limbs": creature(0.4, 5),
    "irregular": shaken(creature(0.4, 5)),
    "two sheets that almost touch": TriangleMesh(creature(0.4, 5).vertices * (1, 1, 0.02), creature(0.4, 5).faces),
    "60 islands": together(*(TriangleMesh(ISLAND.vertices + 20 * i, ISLAND.faces) for i in range(60))),
}


@pytest.mark.parametrize("name", SHAPES)
def test_two_corrections_suffice_on_any_shape(work, name):
    n_pairs = 300
    eigenpairs(SHAPES[name], n_pairs, "fast")
    assert work["factors"] == 2
    # One solve for the first functions, and one for each correction.
    assert work["columns"] <= 3 * (1.1 * n_pairs + multilevel.LEAST_SPARE)
