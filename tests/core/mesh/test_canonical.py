import numpy as np
import pytest
from shapes import figure, icosphere

from wks_segment.core import TriangleMesh, connect
from wks_segment.core.mesh.canonical import Frame, most_spread, order_of_faces, order_of_vertices, spread
from wks_segment.core.mesh.surface import prepare_surface


def bent():
    """A body that is not symmetric, and its vertices are at different places along every direction."""
    mesh = figure(0.5, 0.1)
    return TriangleMesh(mesh.vertices * (1, 1.1, 0.9) + 0.05 * np.sin(mesh.vertices[:, [1, 2, 0]]), mesh.faces)


def mixed(mesh, seed):
    """The mesh turned, moved, scaled, and with its vertices, faces and corners in another order; and both orders."""
    random = np.random.default_rng(seed)
    turn = np.linalg.qr(random.normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    vertices, faces = random.permutation(mesh.n_vertices), random.permutation(mesh.n_faces)
    number = np.argsort(vertices)
    corners = (np.arange(3) + random.integers(0, 3, (mesh.n_faces, 1))) % 3
    moved = 3.7 * mesh.vertices @ turn + (5, -2, 1)
    return (
        TriangleMesh(moved[vertices], np.take_along_axis(number[mesh.faces[faces]], corners, axis=1)),
        vertices,
        faces,
    )


@pytest.mark.parametrize("seed", range(3))
def test_places_and_order_do_not_depend_on_the_file(seed):
    mesh = bent()
    other, vertices, faces = mixed(mesh, seed)
    np.testing.assert_array_equal(vertices[order_of_vertices(other)], order_of_vertices(mesh))
    np.testing.assert_array_equal(faces[order_of_faces(other)], order_of_faces(mesh))
    places, expected = Frame.of(other).places(other.vertices), Frame.of(mesh).places(mesh.vertices)
    np.testing.assert_allclose(places, expected[vertices], atol=1e-9)


@pytest.mark.parametrize("seed", range(2))
def test_the_surface_of_a_mesh_is_the_same_in_whatever_order_it_is_written(seed):
    mesh = bent()
    other, vertices, faces = mixed(mesh, seed)
    surfaces = [prepare_surface(one, 4 * one.n_vertices) for one in (mesh, other)]
    np.testing.assert_array_equal(surfaces[0].mesh.faces, surfaces[1].mesh.faces)
    np.testing.assert_array_equal(faces[surfaces[1].face_of], surfaces[0].face_of)
    np.testing.assert_array_equal(surfaces[1].vertex_of, surfaces[0].vertex_of[vertices])
    lengths = [np.sort(one.mesh.lengths, axis=1) for one in surfaces]
    np.testing.assert_array_equal(lengths[1], lengths[0])


def test_a_frame_lies_in_the_middle_and_along_the_body():
    mesh = icosphere(2)
    long = TriangleMesh(mesh.vertices * (1, 4, 2) + (1, 2, 3), mesh.faces)
    frame = Frame.of(long)
    np.testing.assert_allclose(frame.middle, (1, 2, 3), atol=1e-9)
    np.testing.assert_allclose(np.abs(frame.axes), np.eye(3)[:, [1, 2, 0]], atol=1e-9)
    np.testing.assert_allclose(
        frame.unit * np.linalg.norm(frame.places(long.vertices), axis=1),
        np.linalg.norm(long.vertices - (1, 2, 3), axis=1),
    )


def test_the_pose_whose_limbs_are_stretched_out_is_the_most_spread():
    straight, folded = figure(0.0, 0.0), figure(2.0, 2.0)
    assert spread(straight) > spread(folded)
    assert most_spread([folded, straight]) is straight
    assert spread(TriangleMesh(10 * straight.vertices + 5, straight.faces)) == pytest.approx(spread(straight))


def test_ties_of_islands_do_not_depend_on_the_order_of_vertices():
    sphere = icosphere(2)
    row = [sphere.vertices * (1, 1, 0.8 + 0.1 * i) + (2.05 * i, 0.1 * i * i, 0) for i in range(3)]
    faces = np.concatenate([sphere.faces + i * sphere.n_vertices for i in range(3)])
    places = np.concatenate(row)
    mesh = TriangleMesh(places + 0.05 * np.sin(places[:, [1, 2, 0]] + 0.3), faces)
    other, vertices, _ = mixed(mesh, 0)
    ties, expected = (set(map(frozenset, one.tolist())) for one in (vertices[connect(other).ties], connect(mesh).ties))
    assert ties == expected
