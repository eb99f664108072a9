import numpy as np
import pytest
from shapes import icosphere, together

from wks_segment.core import PoseSegmentation, TriangleMesh
from wks_segment.core.parts.visibility import visible
from wks_segment.core.poses.pose_cache import Workpiece


def described(mesh):
    return Workpiece(PoseSegmentation(n_eigenpairs=30, n_energies=10).describe(mesh))


def dumbbell(subdivisions=3):
    """Two balls along x with a thin bar between them."""
    sphere = icosphere(subdivisions)
    x = sphere.vertices[:, 0]
    apart = sphere.vertices + np.outer(np.sign(x) * 1.2 * np.minimum(np.abs(x) / 0.35, 1), (1, 0, 0))
    waist = 1 - 0.75 * np.exp(-((x / 0.3) ** 4))
    return TriangleMesh(apart * np.stack([np.ones_like(x), waist, waist], axis=1), sphere.faces)


@pytest.fixture(scope="module")
def balls():
    mesh = dumbbell()
    faces = np.flatnonzero(np.abs(mesh.face_centers[:, 0]) > 1.4)[::6]
    return mesh, faces, mesh.face_centers[faces, 0] > 0


def test_places_of_a_ball_see_each_other():
    assert visible(described(icosphere(3)), np.arange(0, 1280, 16)).mean() > 0.99


def test_places_in_one_ball_of_a_dumbbell_see_each_other_and_those_in_the_other_hardly(balls):
    mesh, faces, right = balls
    seen = visible(described(mesh), faces)
    assert seen[np.ix_(right, right)].mean() > 0.97
    assert seen[np.ix_(~right, ~right)].mean() > 0.97
    assert seen[np.ix_(right, ~right)].mean() < 0.15


def test_sight_is_mutual_and_each_place_sees_itself(balls):
    mesh, faces, _ = balls
    seen = visible(described(mesh), faces)
    np.testing.assert_array_equal(seen, seen.T)
    assert seen.diagonal().all()


def test_orientation_of_faces_and_size_do_not_matter(balls):
    mesh, faces, _ = balls
    seen = visible(described(mesh), faces)
    for other in (TriangleMesh(mesh.vertices, mesh.faces[:, ::-1]), TriangleMesh(1e3 * mesh.vertices, mesh.faces)):
        assert (visible(described(other), faces) == seen).mean() > 0.995


def test_separate_balls_do_not_see_each_other():
    ball = icosphere(2)
    both = together(ball, TriangleMesh(ball.vertices + (4, 0, 0), ball.faces))
    seen = visible(described(both), np.arange(0, both.n_faces, 8))
    half = len(seen) // 2
    assert seen[:half, :half].mean() > 0.97
    assert seen[:half, half:].mean() < 0.02


def test_a_single_place_sees_itself():
    assert visible(described(icosphere(2)), np.array([3])).tolist() == [[True]]
