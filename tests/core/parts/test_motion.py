import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from shapes import creature, grid, icosphere, together

from wks_segment.core import TriangleMesh
from wks_segment.core.parts.motion import MOST_PAIRS, edge_correlations, pairs_of_poses, turns

THIRTY = np.radians(30)
AXES = [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 1), (2, -1, 0.5)]
BALLS = together(icosphere(2), TriangleMesh(icosphere(2).vertices + (3, 0, 0), icosphere(2).faces))
HALVES = np.repeat([0, 1], BALLS.n_faces // 2)


def rotation(angle, axis=(1, 1, 1)):
    return Rotation.from_rotvec(angle * np.array(axis) / np.linalg.norm(axis)).as_matrix()


def moved(mesh, turn, offset=(0, 0, 0), scale=1.0):
    return TriangleMesh(scale * mesh.vertices @ turn.T + offset, mesh.faces)


def second_half_turned(turn):
    """The two balls, the second one turned."""
    half = BALLS.n_vertices // 2
    return TriangleMesh(np.concatenate([BALLS.vertices[:half], BALLS.vertices[half:] @ turn.T]), BALLS.faces)


def turn_between(poses, region):
    """Angle by which region 1 turns against region 0."""
    sums = edge_correlations(poses, region)
    areas = np.mean([np.bincount(region, pose.face_areas / pose.area) for pose in poses], axis=0)
    return float(turns(sums[:1], sums[1:2], areas[:1], areas[1:2])[0])


@pytest.mark.parametrize("axis", AXES)
def test_halves_that_turn_apart_by_an_angle_have_this_turn(axis):
    assert turn_between([BALLS, second_half_turned(rotation(THIRTY, axis))], HALVES) == pytest.approx(THIRTY, rel=0.05)


def test_the_turn_does_not_depend_on_the_axis_and_grows_with_the_angle():
    angles = np.radians([5, 15, 30, 60, 90])
    found = [[turn_between([BALLS, second_half_turned(rotation(t, a))], HALVES) for t in angles] for a in AXES]
    np.testing.assert_allclose(found, np.tile(found[0], (len(AXES), 1)), rtol=1e-6)
    assert (np.diff(found[0]) > 0).all()
    np.testing.assert_allclose(found[0][:3] / angles[:3], found[0][0] / angles[0], rtol=0.02)


def test_a_mesh_that_moves_as_a_whole_has_no_turns():
    body = creature(0.3, 2)
    region = (body.face_centers[:, 0] > 0.5).astype(int)
    poses = [body, moved(body, rotation(2.0), (5, -3, 1)), moved(body, rotation(-3.0, AXES[4]), scale=40.0)]
    assert turn_between(poses, region) < 1e-6


def test_the_turn_is_that_of_the_parts_when_the_whole_mesh_is_turned_moved_and_scaled():
    pose = second_half_turned(rotation(THIRTY))
    plain = turn_between([BALLS, pose], HALVES)
    assert plain > 0.3
    for scale in (1e-3, 1.0, 1e3):
        changed = moved(pose, rotation(1.0, AXES[4]), (1, 2, 3), scale)
        assert turn_between([BALLS, changed], HALVES) == pytest.approx(plain, rel=1e-6)


def test_regions_of_any_size_turn_by_the_same_angle():
    pose = second_half_turned(rotation(THIRTY))
    # Region 2 is the rest of the second ball, so that region 1 is a small part of it.
    region = np.where((HALVES == 1) & (BALLS.face_centers[:, 2] > 0.8), 2, HALVES)
    small, sums = np.where(region == 2, 1, np.where(region == 1, 2, 0)), edge_correlations([BALLS, pose], HALVES)
    assert np.bincount(small)[1] < 0.2 * np.bincount(small)[2]
    assert turn_between([BALLS, pose], small) == pytest.approx(turn_between([BALLS, pose], HALVES), rel=0.1)
    # The two parts of one ball move alike.
    parts, areas = edge_correlations([BALLS, pose], region), np.bincount(region, BALLS.face_areas / BALLS.area)
    assert turns(parts[1:2], parts[2:], areas[1:2], areas[2:])[0] < 1e-6
    np.testing.assert_allclose(parts[1] + parts[2], sums[1], atol=1e-12)


def test_flat_halves_that_fold_or_spin_have_a_turn():
    sheet = grid(8, 8)
    region = (sheet.face_centers[:, 0] > 0.5).astype(int)
    for axis in AXES[:3]:
        # The halves come apart at the border: each face is turned with its own half.
        corners = sheet.vertices[sheet.faces].reshape(-1, 3)
        faces = np.arange(len(corners)).reshape(-1, 3)
        turned = np.where(np.repeat(region, 3)[:, None] == 1, corners @ rotation(THIRTY, axis).T, corners)
        found = turn_between([TriangleMesh(corners, faces), TriangleMesh(turned, faces)], region)
        assert 0.7 * THIRTY < found < 1.2 * THIRTY


def test_a_single_pose_has_no_turns():
    sums = edge_correlations([BALLS], HALVES)
    assert sums.shape == (2, 0, 3, 3)
    assert turn_between([BALLS], HALVES) == 0


def test_faces_without_area_and_regions_without_area_turn_nothing():
    vertices = np.concatenate([BALLS.vertices, [(0, 0, 0), (1, 0, 0), (2, 0, 0)]])
    faces = np.concatenate([BALLS.faces, [np.arange(3) + BALLS.n_vertices]])
    turned = np.concatenate([second_half_turned(rotation(THIRTY)).vertices, vertices[-3:]])
    poses = [TriangleMesh(vertices, faces), TriangleMesh(turned, faces)]
    sums = edge_correlations(poses, np.append(HALVES, 2))
    assert np.isfinite(sums).all()
    found = turns(sums[:1], sums[2:], np.array([0.5]), np.array([0.0]))
    assert np.isfinite(found).all()


def test_pairs_of_few_poses_are_all_and_of_many_poses_a_few_different_ones():
    assert pairs_of_poses(1) == []
    assert pairs_of_poses(3) == [(0, 1), (0, 2), (1, 2)]
    assert len(pairs_of_poses(5)) == MOST_PAIRS
    many = pairs_of_poses(40)
    assert len(set(many)) == MOST_PAIRS
    assert all(0 <= i < j < 40 for i, j in many)
    assert edge_correlations([BALLS] * 8, HALVES).shape[1] == MOST_PAIRS
