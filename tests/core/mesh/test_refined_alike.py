"""The surfaces of all poses of a mesh are refined alike, and a pose that is stretched far more is refined further."""

import numpy as np
from shapes import creature

from wks_segment.core import TriangleMesh, prepare_surface
from wks_segment.core.mesh.surface import connect


def longest_edge(surface):
    mesh = surface.mesh.with_unit_area()
    corners = mesh.vertices[mesh.faces]
    return np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max()


def without_some_faces(mesh):
    near = np.linalg.norm(mesh.face_centers - mesh.vertices[100], axis=1) < 0.15
    return TriangleMesh(mesh.vertices, mesh.faces[~near])


def test_poses_have_the_same_triangles():
    poses = [without_some_faces(creature(bend, 3)) for bend in (0.0, 0.4, 0.8)]
    connection = connect(*poses)
    surfaces = [prepare_surface(pose, 4000, connection) for pose in poses]
    assert surfaces[0].mesh.n_vertices > 4000
    for surface in surfaces[1:]:
        np.testing.assert_array_equal(surface.mesh.faces, surfaces[0].mesh.faces)
        np.testing.assert_array_equal(surface.face_of, surfaces[0].face_of)


def test_a_single_pose_is_refined_by_its_own_lengths():
    pose = creature(0.4, 3)
    alone, of_itself = prepare_surface(pose, 4000), prepare_surface(pose, 4000, connect(pose, rest=pose))
    np.testing.assert_array_equal(alone.mesh.faces, of_itself.mesh.faces)


def test_what_is_stretched_far_beyond_rest_is_refined_further():
    rest = creature(0.0, 3)
    far = rest.vertices.copy()
    far[far[:, 2] > np.median(far[:, 2])] *= (1, 1, 12)
    stretched = TriangleMesh(far, rest.faces)
    surfaces = [prepare_surface(pose, 3000, connect(rest, stretched, rest=rest)) for pose in (rest, stretched)]
    assert surfaces[1].mesh.n_vertices > surfaces[0].mesh.n_vertices
    assert longest_edge(surfaces[1]) < 2.9 / np.sqrt(3000)
