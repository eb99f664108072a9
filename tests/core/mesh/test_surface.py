import numpy as np
import pytest
from shapes import grid, icosphere, places_on, split_at_every_corner, together

from wks_segment.core import TriangleMesh, connect, prepare_surface
from wks_segment.core.mesh.surface import shares_at_vertices


def test_a_triangle_soup_is_welded_to_the_closed_surface():
    sphere = icosphere(2)
    surface = prepare_surface(split_at_every_corner(sphere))
    assert surface.mesh.n_vertices == sphere.n_vertices
    assert surface.n_islands == surface.n_components == 1
    np.testing.assert_array_equal(surface.mesh.components, surface.mesh.islands)


def test_a_seam_is_welded_in_spite_of_rounding():
    soup = split_at_every_corner(icosphere(2))
    noise = 1e-8 * np.random.default_rng(0).standard_normal(soup.vertices.shape)
    surface = prepare_surface(TriangleMesh(soup.vertices + noise, soup.faces))
    assert surface.mesh.n_vertices == icosphere(2).n_vertices


def test_a_far_vertex_does_not_weld_the_others():
    mesh = grid(4, 4)
    for faces in (mesh.faces, np.concatenate([mesh.faces, [(0, 1, mesh.n_vertices)]])):
        mesh_with_far_vertex = TriangleMesh(np.concatenate([mesh.vertices, [(1e9, 0, 0)]]), faces)
        assert len(np.unique(prepare_surface(mesh_with_far_vertex).welded_faces)) == len(np.unique(faces))


def test_surfaces_that_only_touch_are_not_welded():
    # Two closed spheres that touch in a point, as lips or a hand on the hip do: no open border, so no seam.
    a = icosphere(2)
    b = TriangleMesh(a.vertices + (a.vertices[0] - a.vertices[3]), a.faces)
    assert prepare_surface(together(a, b), pieces="separate").n_islands == 2


def test_values_return_to_the_original_vertices():
    soup = split_at_every_corner(icosphere(2))
    surface = prepare_surface(soup, min_vertices=1000)
    np.testing.assert_allclose(surface.to_vertices(places_on(surface)), soup.vertices, atol=1e-8)


@pytest.mark.parametrize("min_vertices", [0, 500, 5000])
def test_refinement_adds_enough_vertices_without_changing_the_shape(min_vertices):
    coarse = icosphere(2)
    surface = prepare_surface(coarse, min_vertices)
    assert surface.mesh.n_vertices >= min_vertices
    assert surface.mesh.area == pytest.approx(1)
    # The value of a face is a mean over its area: for coordinates, its center.
    np.testing.assert_allclose(surface.to_faces(places_on(surface)), coarse.face_centers, atol=1e-8)


def test_a_vertex_without_a_face_takes_the_value_of_the_nearest_vertex():
    mesh = grid(3, 3)
    with_extra_vertex = TriangleMesh(np.concatenate([mesh.vertices, [(1.1, 1.1, 0)]]), mesh.faces)
    surface = prepare_surface(with_extra_vertex)
    assert surface.mesh.n_vertices == mesh.n_vertices
    values = surface.to_vertices(np.arange(surface.mesh.n_vertices))
    assert values[-1] == values[mesh.vertices.tolist().index([1, 1, 0])]


def test_a_face_that_collapses_in_welding_gets_a_value():
    # The second face is a needle whose ends are at the same position.
    vertices = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 0, 0), (0.5, 0, 0)]
    surface = prepare_surface(TriangleMesh(vertices, [(0, 1, 2), (1, 3, 4)]))
    assert surface.mesh.n_faces == 1
    assert np.isfinite(surface.to_faces(surface.mesh.vertices)).all()


def test_an_error_says_that_all_faces_collapse():
    # A needle whose short edge has almost no length.
    vertices = [(0, 0, 0), (1, 0, 0), (1, 1e-8, 0)]
    with pytest.raises(ValueError, match="collapses"):
        prepare_surface(TriangleMesh(vertices, [(0, 1, 2)]))


def test_vertices_shrunk_to_a_point_become_one():
    # A bone scaled to zero hides vertices: none of them may become an island.
    sphere = icosphere(3)
    vertices = sphere.vertices.copy()
    hidden = vertices[:, 2] > 0.7
    vertices[hidden] = (0, 0, 0.7)
    surface = prepare_surface(TriangleMesh(vertices, sphere.faces), 3000)
    assert surface.n_islands == 1
    assert np.unique(surface.vertex_of[hidden]).size == 1


def test_islands_that_touch_in_some_poses_are_not_welded():
    upper, lower = grid(8, 8), grid(8, 8)
    touching = together(upper, TriangleMesh(lower.vertices + (1, 0, 0), lower.faces))
    apart = together(upper, TriangleMesh(lower.vertices + (1.5, 0, 0), lower.faces))
    assert prepare_surface(touching).n_islands == 1
    assert prepare_surface(touching, connection=connect(touching, apart, pieces="separate")).n_islands == 2


def test_tiny_islands_are_left_out_and_take_the_nearest_value():
    speck = TriangleMesh(0.005 * icosphere(0).vertices + (1.01, 0, 0), icosphere(0).faces)
    surface = prepare_surface(together(icosphere(3), *[speck] * 30))
    assert surface.n_islands == 1
    places = surface.to_vertices(surface.mesh.vertices)
    ball = icosphere(3).vertices
    nearest = places[np.linalg.norm(ball - (1, 0, 0), axis=1).argmin()]
    assert np.abs(places[-12:] - nearest).max() < 0.1
    assert surface.to_faces(surface.mesh.vertices).shape == (icosphere(3).n_faces + 600, 3)


def test_a_mesh_of_many_small_islands_is_a_surface():
    cards = [TriangleMesh(grid(1, 1).vertices + (2 * i, 0, 0), grid(1, 1).faces) for i in range(1500)]
    assert prepare_surface(together(*cards), pieces="separate").n_islands == 100
    assert prepare_surface(together(*cards)).n_islands == 1


def test_the_shares_of_regions_at_a_vertex_are_those_of_the_area_around_it():
    mesh = icosphere(2)
    surface = prepare_surface(mesh)
    region = np.random.default_rng(0).integers(-1, 3, mesh.n_faces)
    shares = shares_at_vertices(surface, region, 4)
    assert shares.shape == (mesh.n_vertices, 4)
    for vertex in range(0, mesh.n_vertices, 17):
        around = (surface.mesh.faces == vertex).any(axis=1) & (region[surface.face_of] >= 0)
        areas = np.bincount(region[surface.face_of[around]], surface.mesh.face_areas[around], 4)
        np.testing.assert_allclose(shares[vertex], areas / max(areas.sum(), 1e-300), atol=1e-12)


def test_a_vertex_without_a_region_around_it_has_no_shares():
    mesh = icosphere(1)
    upper = mesh.face_centers[:, 2] > 0
    surface = prepare_surface(mesh)
    shares = surface.to_vertices(shares_at_vertices(surface, np.where(upper, 0, -1), 1))
    inside = np.isin(np.arange(mesh.n_vertices), mesh.faces[upper])
    np.testing.assert_array_equal(shares[:, 0], inside)
