import numpy as np
import pytest
from shapes import grid, icosphere, split_at_every_corner, together

from wks_segment.core import TriangleMesh, prepare_surface


def test_a_soup_of_triangles_is_welded_to_the_surface_it_was():
    sphere = icosphere(2)
    surface = prepare_surface(split_at_every_corner(sphere))
    assert surface.mesh.n_vertices == sphere.n_vertices
    assert surface.n_components == 1


def test_rounding_does_not_keep_a_seam_open():
    soup = split_at_every_corner(icosphere(2))
    noise = 1e-8 * np.random.default_rng(0).standard_normal(soup.vertices.shape)
    surface = prepare_surface(TriangleMesh(soup.vertices + noise, soup.faces))
    assert surface.mesh.n_vertices == icosphere(2).n_vertices


def test_surfaces_that_only_touch_are_not_welded():
    # Two closed spheres that share a point, as lips or a hand on the hip do: no open border, no seam.
    a = icosphere(2)
    b = TriangleMesh(a.vertices + (a.vertices[0] - a.vertices[3]), a.faces)
    assert prepare_surface(together(a, b)).n_components == 2


def test_each_vertex_gets_its_value_back():
    soup = split_at_every_corner(icosphere(2))
    surface = prepare_surface(soup, min_vertices=1000)
    np.testing.assert_allclose(surface.to_vertices(surface.mesh.vertices), soup.vertices, atol=1e-12)


@pytest.mark.parametrize("min_vertices", [0, 500, 5000])
def test_refining_is_flat_and_as_often_as_needed(min_vertices):
    coarse = icosphere(2)
    surface = prepare_surface(coarse, min_vertices)
    assert surface.mesh.n_vertices >= min_vertices
    assert surface.mesh.area == pytest.approx(coarse.area)
    # The value of a face is the mean over its pieces: for coordinates, its centre.
    centres = coarse.vertices[coarse.faces].mean(axis=1)
    np.testing.assert_allclose(surface.to_faces(surface.mesh.vertices), centres, atol=1e-12)


def test_a_vertex_without_a_face_takes_the_nearest_ones_value():
    mesh = grid(3, 3)
    with_stray = TriangleMesh(np.concatenate([mesh.vertices, [(1.1, 1.1, 0)]]), mesh.faces)
    surface = prepare_surface(with_stray)
    assert surface.mesh.n_vertices == mesh.n_vertices
    assert surface.to_vertices(surface.mesh.vertices)[-1].tolist() == [1, 1, 0]


def test_a_face_that_collapses_in_welding_still_gets_a_value():
    # The second face is a needle whose two ends are the same place.
    vertices = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 0, 0), (0.5, 0, 0)]
    surface = prepare_surface(TriangleMesh(vertices, [(0, 1, 2), (1, 3, 4)]))
    assert surface.mesh.n_faces == 1
    assert np.isfinite(surface.to_faces(surface.mesh.vertices)).all()


def test_nothing_left_is_an_error():
    # Big enough to have an area, but its corners are one place compared with the far-away stray vertex.
    vertices = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (1e9, 0, 0)]
    with pytest.raises(ValueError, match="collapses"):
        prepare_surface(TriangleMesh(vertices, [(0, 1, 2)]))
