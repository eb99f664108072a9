"""A model depends on the shape of what is learned, and not on how it is written."""

import numpy as np
import pytest
from shapes import figure

from wks_segment.core import PoseSegmentation, TriangleMesh, connect

BENDS = ((0.0, 0.0), (0.6, 0.2), (-0.3, 0.5))


def poses():
    """A figure that is not symmetric, in three poses."""
    return [
        TriangleMesh(mesh.vertices + 0.04 * np.sin(3 * mesh.vertices[:, [1, 2, 0]]), mesh.faces)
        for mesh in (figure(*bend) for bend in BENDS)
    ]


def written_otherwise(meshes, seed):
    """Poses turned, moved and scaled, each in its own way, with all in another order; and the order of the faces."""
    random = np.random.default_rng(seed)
    vertex, face = random.permutation(meshes[0].n_vertices), random.permutation(meshes[0].n_faces)
    corners = (np.arange(3) + random.integers(0, 3, (len(face), 1))) % 3
    faces = np.take_along_axis(np.argsort(vertex)[meshes[0].faces[face]], corners, axis=1)
    result = []
    for i in random.permutation(len(meshes)):
        turn = np.linalg.qr(random.normal(size=(3, 3)))[0]
        moved = random.uniform(0.1, 10) * meshes[i].vertices @ (turn * np.sign(np.linalg.det(turn))) + random.normal()
        result.append(TriangleMesh(moved[vertex], faces))
    return result, face


def learned(meshes):
    """Model of poses of a mesh, and their labels."""
    model = PoseSegmentation(n_segments=5, n_eigenpairs=60, n_energies=30)
    described = model.describe_all(meshes, [connect(*meshes)] * len(meshes))
    model.fit(described)
    return model, model.segment_polygons(described, [np.arange(meshes[0].n_faces)] * len(meshes))


@pytest.fixture(scope="module")
def as_it_is():
    return learned(poses())


@pytest.mark.parametrize("seed", range(2))
def test_the_labels_of_a_mesh_do_not_depend_on_how_it_is_written(as_it_is, seed):
    others, face = written_otherwise(poses(), seed)
    model, labels = learned(others)
    np.testing.assert_array_equal(labels, as_it_is[1][face])
    np.testing.assert_allclose(model.mixture_.means, as_it_is[0].mixture_.means, atol=1e-3)


def test_a_mesh_in_another_pose_is_labeled_alike_however_it_is_written(as_it_is):
    unseen = figure(0.2, 0.3)
    (other,), face = written_otherwise([unseen], 5)
    model = as_it_is[0]
    same = model.segment_faces(other) == model.segment_faces(unseen)[face]
    assert np.average(same, weights=other.face_areas) > 0.999
