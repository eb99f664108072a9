import numpy as np
import pytest
from shapes import figure, icosphere, split_at_every_corner, together

from wks_segment.core import PoseSegmentation, TriangleMesh
from wks_segment.core.parts.evidence import MOST_SHAPES, TIE_CURVATURE, Evidence, tied_faces
from wks_segment.core.poses.pose_cache import Workpiece
from wks_segment.core.progress import Progress


def described(*meshes, **parameters):
    model = PoseSegmentation(n_eigenpairs=30, n_energies=10, **parameters)
    return [Workpiece(pose) for pose in model.describe_all(meshes)]


def evidence_of(*meshes, rest=None, **parameters):
    return Evidence.of(described(*meshes, **parameters), rest, Progress())


def two_balls():
    ball = icosphere(2)
    return together(ball, TriangleMesh(0.5 * ball.vertices + (2, 0, 0), ball.faces))


@pytest.fixture(scope="module")
def poses():
    return [figure(subdivisions=2), figure(0.6, -0.3, subdivisions=2)]


def test_values_are_means_over_the_poses(poses):
    both, (first, second) = evidence_of(*poses), (evidence_of(pose) for pose in poses)
    for name in ("areas", "thickness", "curvature", "fine_curvature"):
        mean = (getattr(first, name) + getattr(second, name)) / 2
        np.testing.assert_allclose(getattr(both, name), mean, rtol=1e-3)
    np.testing.assert_allclose(both.neighbors.lengths, (first.neighbors.lengths + second.neighbors.lengths) / 2)
    np.testing.assert_array_equal(both.centers, first.centers)
    assert both.areas.sum() == pytest.approx(1)


def test_each_value_is_of_its_face_or_border(poses):
    evidence, m = evidence_of(*poses), poses[0].n_faces
    for name in ("areas", "centers", "thickness", "image"):
        assert len(getattr(evidence, name)) == m
    for values in (evidence.curvature, evidence.fine_curvature, evidence.neighbors.lengths):
        assert len(values) == len(evidence.neighbors.pairs) == 1.5 * m
        assert np.isfinite(values).all()


def test_the_size_of_each_pose_does_not_matter(poses):
    large = TriangleMesh(1e3 * poses[1].vertices, poses[1].faces)
    expected, found = evidence_of(*poses), evidence_of(poses[0], large)
    for name in ("areas", "thickness", "curvature", "fine_curvature"):
        np.testing.assert_allclose(getattr(found, name), getattr(expected, name), atol=1e-3)
    np.testing.assert_allclose(found.neighbors.lengths, expected.neighbors.lengths)


def test_a_posed_mesh_is_symmetric_by_its_rest(poses):
    rest, posed = poses
    expected = evidence_of(rest).image
    assert (expected >= 0).all()
    np.testing.assert_array_equal(evidence_of(posed, rest=rest).image, expected)
    without = evidence_of(posed).image
    assert without is None or (without < 0).any()


def test_islands_are_tied_by_faces_near_each_other():
    mesh, half = two_balls(), icosphere(2).n_faces
    evidence = evidence_of(mesh)
    pairs = evidence.neighbors.pairs
    across = (pairs[:, 0] < half) != (pairs[:, 1] < half)
    assert across.any()
    assert (evidence.curvature[across] == TIE_CURVATURE).all()
    assert (evidence.neighbors.lengths[across] > 0).all()
    ends = evidence.centers[pairs[across]]
    # The gap between the balls is half a radius wide.
    assert (np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1) < 1.2 / np.sqrt(mesh.area)).all()


def test_separate_islands_are_not_tied():
    pose = described(two_balls(), pieces="separate")[0]
    pairs, lengths = tied_faces(pose.surface)
    assert len(pairs) == len(lengths) == 0


def test_a_triangle_soup_has_the_values_of_the_welded_mesh():
    mesh = figure(subdivisions=2)
    expected, found = evidence_of(mesh), evidence_of(split_at_every_corner(mesh))
    assert set(map(tuple, np.sort(found.neighbors.pairs))) == set(map(tuple, np.sort(expected.neighbors.pairs)))
    np.testing.assert_allclose(found.thickness, expected.thickness, atol=0.02)


def test_shapes_of_a_few_of_many_poses_are_measured(poses):
    many = [figure(bend, subdivisions=2) for bend in np.linspace(0, 1, MOST_SHAPES + 4)]
    workpieces = described(*many)
    evidence = Evidence.of(workpieces, None, Progress())
    assert len(evidence.poses) == len(many)
    expected = np.mean([mesh.face_areas / mesh.area for mesh in many], axis=0)
    np.testing.assert_allclose(evidence.areas, expected)
    few = evidence_of(*many[:: (len(many) - 1) // (MOST_SHAPES - 1)])
    np.testing.assert_allclose(evidence.curvature, few.curvature, rtol=1e-6, atol=1e-6)


def test_progress_rises_to_the_end_and_an_error_ends_the_work(poses):
    workpieces, shares = described(*poses), []
    Evidence.of(workpieces, None, Progress(lambda stage, share: shares.append(share)))
    assert shares == sorted(shares)
    assert shares[0] == 0
    assert shares[-1] == 1

    def cancel(stage, share):
        if share > 0.6:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        Evidence.of(described(*poses), None, Progress(cancel))
