import numpy as np
import pytest
from shapes import creature, figure, grid, icosphere, shaken, together

from wks_segment.core import PoseSegmentation, TriangleMesh, connect, prepare_surface
from wks_segment.core.mesh.mirror import Mirror, is_exact, mirror_of, mirrored_faces


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


def test_the_two_sides_of_a_mirror_are_those_of_the_plane(body):
    mirror = mirror_of([body])
    x = body.face_centers[:, 0]
    assert set(mirror.side[x > 1e-9]) == {-mirror.side[x.argmin()]}
    assert set(mirror.side[x < -1e-9]) == {mirror.side[x.argmin()]}
    assert set(mirror.side[np.abs(x) > 1e-9]) == {-1, 1}
    np.testing.assert_array_equal(mirror.side[mirror.image], -mirror.side)


def test_the_most_symmetric_pose_shows_the_mirror_images(body):
    posed = figure(0.5, 0.0, 3)
    for poses in ([body, posed], [posed, body], [posed, body, posed]):
        mirror = mirror_of(poses)
        np.testing.assert_array_equal(mirror.image, mirrored_faces(body))
        assert mirror.is_exact(body.face_areas)
    alone = mirror_of([posed])
    assert alone is None or not alone.is_exact(posed.face_areas)
    assert mirror_of([blob()]) is None


# Five faces: 0 and 3 are mirror images, 1 is its own, 2 and 4 have none.
FIVE = Mirror(np.array([3, 1, -1, 0, -1]), np.array([1, 0, 1, -1, -1]))


def test_values_are_averaged_with_those_of_the_mirror_images():
    values = np.array([(1.0, 10), (2, 20), (3, 30), (4, 40), (5, 50)])
    before = values.copy()
    np.testing.assert_array_equal(FIVE.mean(values), [(2.5, 25), (2, 20), (3, 30), (2.5, 25), (5, 50)])
    np.testing.assert_array_equal(FIVE.mean(values[:, 0]), [2.5, 2, 3, 2.5, 5])
    np.testing.assert_array_equal(values, before)


def test_labels_of_one_side_are_copied_to_the_other():
    np.testing.assert_array_equal(FIVE.copied(np.array([7, 1, 2, 3, 4])), [7, 1, 2, 7, 4])


def test_a_mirror_is_exact_if_nearly_all_area_has_an_image():
    areas = np.array([1.0, 1, 1e-4, 1, 1e-4])
    assert FIVE.is_exact(areas)
    assert not FIVE.is_exact(areas + 0.1)


def polygons_of_sides(mirror):
    """Polygon of each face: four faces on the left each, their mirror images, and what lies across the plane.

    And the number of polygons on one side.
    """
    left, middle = np.flatnonzero(mirror.side > 0), np.flatnonzero(mirror.side == 0)
    number = np.arange(len(left)) // 4
    count = int(number.max()) + 1
    polygon_of = np.full(len(mirror.side), -1)
    polygon_of[left], polygon_of[mirror.image[left]] = number, count + number
    polygon_of[middle] = 2 * count + np.arange(len(middle)) // 3
    assert polygon_of.min() == 0
    return polygon_of, count


def test_polygons_are_mirrored_like_their_faces(body):
    mirror = mirror_of([body])
    polygon_of, count = polygons_of_sides(mirror)
    n_polygons = int(polygon_of.max()) + 1
    found = mirror.of_polygons(polygon_of, body.face_areas, n_polygons)
    sides = np.arange(count)
    expected = np.concatenate([sides + count, sides, np.arange(2 * count, n_polygons)])
    np.testing.assert_array_equal(found.image, expected)
    np.testing.assert_array_equal(found.side, np.repeat([1, -1, 0], [count, count, n_polygons - 2 * count]))


def test_the_image_of_a_polygon_is_that_of_most_of_its_area():
    """Polygon 0 of the faces 0 to 2 faces 1 with one large face, and 2 with two small ones."""
    mirror = Mirror(np.array([3, 4, 5, 0, 1, 2]), np.array([1, 1, 1, -1, -1, -1]))
    polygon_of, areas = np.array([0, 0, 0, 1, 2, 2]), np.array([3.0, 1, 1, 3, 1, 1])
    found = mirror.of_polygons(polygon_of, areas, 4)
    assert found.image.tolist() == [1, 0, -1, -1]
    assert found.side.tolist() == [1, -1, -1, 0]


def test_faces_without_a_polygon_count_for_none():
    mirror = Mirror(np.array([3, 4, 5, 0, 1, 2]), np.array([1, 1, 1, -1, -1, -1]))
    polygon_of, areas = np.array([0, -1, 2, 1, 1, -1]), np.ones(6)
    found = mirror.of_polygons(polygon_of, areas, 3)
    assert found.image.tolist() == [1, 0, -1]
    assert found.side.tolist() == [1, -1, 1]


POSES = [figure(0.6, -0.1, 3), figure(-0.2, 0.5, 3)]
"""Asymmetric poses of a symmetric figure."""


def test_the_mirror_of_a_connection_is_that_at_rest(body):
    at_rest = connect(*POSES, rest=body)
    np.testing.assert_array_equal(at_rest.mirror.image, mirrored_faces(body))
    assert at_rest.mirror.is_exact(body.face_areas)
    without = connect(*POSES).mirror
    assert without is None or not without.is_exact(POSES[0].face_areas)
    assert connect(body, *POSES).mirror.is_exact(body.face_areas)
    surface = prepare_surface(POSES[0], connection=at_rest)
    assert surface.mirror is at_rest.mirror


def test_a_connection_with_another_mirror_is_another_one(body):
    with_rest, without = connect(*POSES, rest=body).arrays(), connect(*POSES).arrays()
    assert {"image", "side"} <= with_rest.keys()
    assert with_rest.keys() != without.keys() or (with_rest["image"] != without["image"]).any()


@pytest.fixture(scope="module")
def posed(body):
    """Described poses of the symmetric figure, whose mirror images are known from its rest."""
    connection = connect(*POSES, rest=body)
    return PoseSegmentation(4, n_eigenpairs=40, n_energies=20).describe_all(POSES, [connection] * len(POSES))


def test_a_described_pose_keeps_its_mirror(posed):
    again = type(posed[0]).of_arrays(posed[0].arrays())
    np.testing.assert_array_equal(again.surface.mirror.image, posed[0].surface.mirror.image)
    np.testing.assert_array_equal(again.surface.mirror.side, posed[0].surface.mirror.side)


def test_a_symmetric_figure_in_asymmetric_poses_has_symmetric_labels(body, posed):
    image, faces = mirrored_faces(body), np.arange(body.n_faces)
    model = PoseSegmentation(4, n_eigenpairs=40, n_energies=20).fit(posed, rest=body)
    polygon_of, n_of_side = polygons_of_sides(mirror_of([body]))
    for count in (4, 7):
        of_count = model.with_segments(count)
        for labels in (of_count.segment_polygons(posed, [faces] * len(posed)), of_count.segment_faces(posed[1])):
            assert len(set(labels)) > 2
            np.testing.assert_array_equal(labels[image], labels)
        of_polygons = of_count.segment_polygons(posed, [polygon_of] * len(posed))
        np.testing.assert_array_equal(of_polygons[:n_of_side], of_polygons[n_of_side : 2 * n_of_side])


def test_without_the_rest_labels_of_asymmetric_poses_need_not_be_symmetric(body, posed):
    """So the test above does not hold by chance."""
    plain = PoseSegmentation(4, n_eigenpairs=40, n_energies=20).describe_all(POSES)
    model = PoseSegmentation(7, n_eigenpairs=40, n_energies=20).fit(plain)
    labels = model.segment_faces(plain[1])
    assert (labels[mirrored_faces(body)] != labels).any()
