import numpy as np
import pytest
from shapes import creature, figure, grid, icosphere, shaken, together

from wks_segment.core import TriangleMesh
from wks_segment.core.mesh.mirror import is_exact, mirrored_faces


@pytest.fixture(scope="module")
def body():
    return figure(subdivisions=3)


def blob():
    """Ball with bumps that are on no plane of symmetry."""
    points = icosphere(3).vertices
    for axis, height in (((1, 2, 3), 0.7), ((-2, 1, 0.4), 0.5), ((0.3, -1, -2), 0.9), ((-1, -2, 1.5), 0.4)):
        unit = np.array(axis) / np.linalg.norm(axis)
        points = points * (1 + height * np.exp(-(np.arccos(np.clip(points @ unit, -1, 1)) ** 2)))[:, None]
    return TriangleMesh(points, icosphere(3).faces)


def test_left_and_right_of_a_figure_are_mirror_images(body):
    image = mirrored_faces(body)
    assert (image >= 0).all()
    np.testing.assert_array_equal(image[image], np.arange(body.n_faces))
    np.testing.assert_allclose(body.face_centers[image], body.face_centers * (-1, 1, 1), atol=1e-9)
    assert is_exact(image, body.face_areas)


def test_place_size_and_order_of_faces_do_not_matter(body):
    order = np.random.default_rng(0).permutation(body.n_faces)
    image = mirrored_faces(TriangleMesh(1e3 * body.vertices + (5e3, -2e3, 70), body.faces[order]))
    np.testing.assert_array_equal(order[image], mirrored_faces(body)[order])


@pytest.mark.parametrize("axes", [(0, 1, 2), (1, 0, 2), (2, 1, 0)])
def test_a_figure_is_symmetric_along_any_axis(body, axes):
    image = mirrored_faces(TriangleMesh(body.vertices[:, axes], body.faces))
    np.testing.assert_array_equal(image, mirrored_faces(body))


def test_a_blob_is_not_symmetric():
    image = mirrored_faces(blob())
    assert image is None
    assert not is_exact(image, blob().face_areas)


def test_a_posed_figure_is_not_symmetric_as_a_whole():
    posed = figure(left=0.5, right=0.0, subdivisions=3)
    assert not is_exact(mirrored_faces(posed), posed.face_areas)


def test_a_flat_sheet_is_no_mirror_image_of_itself_in_its_plane():
    sheet = grid(12, 7)
    x, y, z = sheet.vertices.T
    # A sheet that has no other symmetry, flat or nearly so.
    bent = np.stack([x + 0.4 * y**2, y + 0.3 * x**3, z], axis=1)
    assert mirrored_faces(TriangleMesh(bent, sheet.faces)) is None
    assert mirrored_faces(TriangleMesh(bent[:, [2, 0, 1]], sheet.faces)) is None
    # But left and right of a flat figure are.
    image = mirrored_faces(grid(12, 7))
    assert is_exact(image, sheet.face_areas)
    assert (image != np.arange(sheet.n_faces)).all()


def test_a_symmetric_body_with_something_on_one_side_is_symmetric_in_part(body):
    hat = TriangleMesh(0.5 * blob().vertices + (1, 0.4, 4), blob().faces)
    both = together(body, hat)
    image = mirrored_faces(TriangleMesh(both.vertices, both.faces))
    # The box of the mesh still has its middle in the plane: the hat is less wide than the arms.
    has = image >= 0
    assert has[: body.n_faces].all()
    assert not has[body.n_faces :].all()
    np.testing.assert_array_equal(image[image[has]], np.flatnonzero(has))
    assert not is_exact(image, both.face_areas)


def test_vertices_without_a_face_do_not_move_the_middle(body):
    stray = TriangleMesh(np.append(body.vertices, [(50, 60, 70)], axis=0), body.faces)
    np.testing.assert_array_equal(mirrored_faces(stray), mirrored_faces(body))


def test_images_are_mutual_on_a_mesh_that_is_roughly_symmetric():
    for mesh in (shaken(figure(subdivisions=3), 0.1), shaken(icosphere(3)), creature(0.0, 3)):
        image = mirrored_faces(mesh)
        if image is not None:
            has = np.flatnonzero(image >= 0)
            np.testing.assert_array_equal(image[image[has]], has)
