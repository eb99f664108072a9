import numpy as np
import pytest
from scipy.spatial import Delaunay
from shapes import creature, grid, icosphere

from wks_segment.core import PoseSegmentation, TriangleMesh, delaunay, eigenpairs, prepare_surface, stiffness_matrix
from wks_segment.core.spectral.intrinsic_delaunay import better_triangles, is_full_of_slivers


def with_caps(mesh, share=1.0, height=0.005):
    """Mesh with a new vertex close to an edge of each face, or of a share of them: angles near 180 degrees."""
    random = np.random.default_rng(0)
    chosen = random.random(mesh.n_faces) < share
    a, b, c = mesh.faces[chosen].T
    t = random.uniform(0.1, 0.9, (len(a), 1))
    v = mesh.vertices
    new = (1 - height) * ((1 - t) * v[a] + t * v[b]) + height * v[c]
    n = mesh.n_vertices + np.arange(len(a))
    faces = [mesh.faces[~chosen], *(np.stack(f, axis=1) for f in ((a, b, n), (b, c, n), (c, a, n)))]
    return TriangleMesh(np.concatenate([v, new]), np.concatenate(faces))


def turned_at_random(mesh):
    faces = mesh.faces.copy()
    chosen = np.random.default_rng(1).random(len(faces)) < 0.5
    faces[chosen] = faces[chosen][:, ::-1]
    return TriangleMesh(mesh.vertices, faces)


def lowest_weight(mesh):
    off = stiffness_matrix(mesh).tocoo()
    return -off.data[off.row < off.col].max()


def glued_sheets():
    """Three half planes that meet in a line, each with random points."""
    random = np.random.default_rng(2)
    vertices, faces = [np.stack([np.linspace(0, 1, 6), np.zeros(6), np.zeros(6)], axis=1)], []
    for angle in (0.0, 2.0, 4.0):
        inner = random.uniform(0.05, 1, (20, 2))
        plane = np.concatenate([np.stack([np.linspace(0, 1, 6), np.zeros(6)], axis=1), inner])
        number = np.append(np.arange(6), 6 + np.arange(20) + sum(map(len, vertices[1:])))
        faces.append(number[Delaunay(plane).simplices])
        along, up = inner.T
        vertices.append(np.stack([along, up * np.cos(angle), up * np.sin(angle)], axis=1))
    return TriangleMesh(np.concatenate(vertices), np.concatenate(faces))


def random_triangulation(inner, border):
    """Triangulation of the unit square: each point in turn splits the triangle that it is in into three."""
    points = np.concatenate([border, inner])
    middle = len(points)
    points = np.concatenate([points, [(0.5, 0.5)]])
    faces = [(middle, i, (i + 1) % len(border)) for i in range(len(border))]
    for p in range(len(border), middle):
        corners = points[np.array(faces)]
        places = np.concatenate([corners.transpose(0, 2, 1), np.ones((len(faces), 1, 3))], axis=1)
        shares = np.linalg.inv(places) @ np.append(points[p], 1)
        i = int(np.flatnonzero((shares > 0).all(axis=1))[0])
        a, b, c = faces[i]
        faces[i : i + 1] = [(a, b, p), (b, c, p), (c, a, p)]
    return points, np.array(faces)


def test_in_the_plane_the_result_is_the_delaunay_triangulation():
    steps = np.arange(8) / 8
    border = np.concatenate([[(t, 0), (1, t), (1 - t, 1), (0, 1 - t)] for t in steps])
    border = border[np.argsort(np.arctan2(*(border - 0.5).T))]
    points, faces = random_triangulation(np.random.default_rng(0).uniform(0.1, 0.9, (150, 2)), border)
    flat = np.column_stack([points, np.zeros(len(points))])
    mesh = TriangleMesh(flat, faces)
    expected = stiffness_matrix(TriangleMesh(flat, Delaunay(points).simplices))
    assert abs(stiffness_matrix(mesh) - expected).max() > 10
    # Weights are about 10; flips of slivers lose digits.
    assert abs(stiffness_matrix(delaunay(mesh)) - expected).max() < 1e-2


@pytest.mark.parametrize(
    "mesh",
    [with_caps(icosphere(2)), with_caps(creature(0.5, 2)), with_caps(grid(7, 6)), glued_sheets()],
    ids=["sphere", "creature", "border", "three sheets"],
)
def test_no_weight_is_negative_and_the_surface_is_the_same(mesh):
    better = delaunay(mesh)
    assert lowest_weight(mesh) < -0.1
    assert lowest_weight(better) > -1e-8
    assert better.area == pytest.approx(mesh.area, rel=1e-4)
    assert better.n_vertices == mesh.n_vertices
    np.testing.assert_allclose(better.vertex_areas.sum(), mesh.area, rtol=1e-4)


@pytest.mark.parametrize("mesh", [with_caps(creature(0.5, 2)), glued_sheets()], ids=["creature", "three sheets"])
def test_the_orientation_of_faces_does_not_matter(mesh):
    assert abs(stiffness_matrix(delaunay(mesh)) - stiffness_matrix(delaunay(turned_at_random(mesh)))).max() < 1e-6


def test_a_mesh_without_slivers_does_not_change():
    sphere = icosphere(2)
    assert better_triangles(sphere, "auto") == (sphere, "cotangent")
    assert abs(stiffness_matrix(delaunay(sphere)) - stiffness_matrix(sphere)).max() < 1e-9


def test_slivers_are_detected_and_the_spectrum_improves():
    coarse = icosphere(1)
    slivers = with_caps(with_caps(coarse))
    assert is_full_of_slivers(slivers)
    assert not is_full_of_slivers(coarse)
    true = eigenpairs(prepare_surface(coarse, 3000).mesh, 30, "exact")[0]
    errors = [
        np.abs(eigenpairs(mesh, 30, "exact")[0][1:] / true[1:] - 1).max() for mesh in (slivers, delaunay(slivers))
    ]
    assert errors[1] < 0.75 * errors[0]


@pytest.mark.parametrize("accuracy", ["fast", "exact"])
def test_both_solvers_accept_the_result_at_any_scale(accuracy):
    better = delaunay(with_caps(creature(0.5, 3)))
    smaller = TriangleMesh(better.vertices / 1000, better.faces, None, better.lengths / 1000, better.layers)
    values = eigenpairs(better, 40, accuracy)[0]
    np.testing.assert_allclose(values, eigenpairs(smaller, 40, accuracy)[0], rtol=1e-3, atol=1e-9)


def test_the_model_chooses_the_laplacian_unless_it_is_given():
    mesh = with_caps(creature(0.5, 3), 0.7)
    used = {
        laplacian: PoseSegmentation(4, n_eigenpairs=30, laplacian=laplacian).describe(mesh).laplacian
        for laplacian in ("auto", "cotangent", "delaunay")
    }
    assert used == {"auto": "delaunay", "cotangent": "cotangent", "delaunay": "delaunay"}
    with pytest.raises(ValueError, match="laplacian must be one of"):
        PoseSegmentation(laplacian="umbrella").describe(mesh)


def test_lengths_that_are_not_finite_are_an_error():
    with pytest.raises(ValueError, match="lengths must be 1 × 3 finite numbers"):
        TriangleMesh(np.eye(3), [(0, 1, 2)], lengths=[(1, 1, np.nan)])
