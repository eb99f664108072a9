"""The mirror plane of a body, whatever the axes of its rig."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from wks_segment.core import TriangleMesh
from wks_segment.core.mesh.symmetry import mirror_normal, upright_axes


def figure(asymmetric=False, cut=(0, 0, 0, 0, 0, 0)):
    """A box with an arm on each side along x, a nose along −y, and a hat along z; one arm longer if asked for.

    `cut` says by which diagonal each side of a box is cut.
    """
    vertices, faces = [], []
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) / 2
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    halves = ((0, 1, 2), (0, 2, 3))
    boxes = [((0, 0, 0), (1, 0.5, 2)), ((1.2, 0, 0.5), (1.4, 0.3, 0.3)), ((-1.2, 0, 0.5), (1.4, 0.3, 0.3))]
    boxes += [((0, -0.5, 0.8), (0.2, 0.5, 0.2)), ((0, 0.1, 1.5), (0.6, 0.6, 0.9))]
    if asymmetric:
        boxes[1] = ((2.2, 0.9, 0.5), (3.4, 0.9, 0.3))
    for center, size in boxes:
        start = len(vertices)
        vertices += (corners * size + center).tolist()
        faces += [[start + q[(i + d) % 4] for i in t] for q, d in zip(quads, cut, strict=True) for t in halves]
    return TriangleMesh(np.array(vertices), np.array(faces))


@pytest.mark.parametrize("turn", [0.0, 33.0, 200.0])
def test_the_plane_comes_from_the_mesh_where_the_rig_is_turned_against_it(turn):
    spin = Rotation.from_euler("z", turn, degrees=True).as_matrix()
    mesh = figure()
    mesh = TriangleMesh(mesh.vertices @ spin.T, mesh.faces)
    rig = spin @ np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])  # its x points to the front
    axes = upright_axes(mesh, rig, [spin @ (0.8, 0.1, 0.1)])
    np.testing.assert_allclose(axes[:, 0], spin[:, 0], atol=1e-6)
    np.testing.assert_allclose(axes.T @ axes, np.eye(3), atol=1e-9)
    opposite = upright_axes(mesh, rig, [spin @ (-0.8, 0.1, 0.1)])
    np.testing.assert_allclose(opposite[:, 0], -spin[:, 0], atol=1e-6)


@pytest.mark.parametrize("cut", [(0, 0, 0, 0, 0, 0), (1, 0, 1, 0, 0, 1), (0, 1, 1, 1, 0, 0)])
def test_the_plane_of_large_faces_does_not_depend_on_their_diagonals(cut):
    """The plane is found by the principal axes alone: neither those of the rig nor those of the world lie in it."""
    spin = Rotation.from_rotvec((0.9, -0.5, 0.4)).as_matrix()
    mesh = figure(cut=cut)
    mesh = TriangleMesh(mesh.vertices @ spin.T, mesh.faces)
    normal = mirror_normal(mesh, np.array([0.0, 0.0, 1.0]), np.eye(3))
    assert abs(normal @ spin[:, 0]) > np.cos(np.radians(1))


@pytest.mark.parametrize("sign", [1, -1])
def test_the_axis_of_the_rig_says_which_side_is_left_unless_that_is_known_better(sign):
    slanted = np.array([[sign * 0.8, -0.6, 0.0], [0.6, sign * 0.8, 0.0], [0.0, 0.0, 1.0]])
    np.testing.assert_allclose(upright_axes(figure(), slanted)[:, 0], (sign, 0, 0), atol=1e-6)
    by_bones = [np.array([-sign, 0.0, 0.0])]
    np.testing.assert_allclose(upright_axes(figure(), slanted, by_bones)[:, 0], (-sign, 0, 0), atol=1e-6)


def test_the_axis_of_the_rig_stays_where_no_plane_is_clearly_better():
    rig = np.array([[0.8, -0.6, 0.0], [0.6, 0.8, 0.0], [0.0, 0.0, 1.0]])
    np.testing.assert_allclose(upright_axes(figure(asymmetric=True), rig)[:, 0], rig[:, 0])
