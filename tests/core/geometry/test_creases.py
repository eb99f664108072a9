import numpy as np
import pytest
from shapes import icosphere, together

from wks_segment.core import TriangleMesh, prepare_surface
from wks_segment.core.geometry.creases import (
    FINE,
    Normals,
    border_shape,
    curvature_across,
    log_thickness,
    outward_signs,
    weights_of_borders,
)
from wks_segment.core.geometry.heat_flow import Flows
from wks_segment.core.mesh.adjacency import FaceAdjacency

AREA_OF_UNIT_SPHERE = 4 * np.pi


def adjacency_of(surface):
    return FaceAdjacency.of(surface.welded_faces, surface.original.vertices)


def test_outward_signs_do_not_depend_on_the_orientation_of_faces():
    sphere = together(icosphere(2), TriangleMesh(icosphere(2).vertices + 5, icosphere(2).faces[:, ::-1]))
    faces = sphere.faces.copy()
    chosen = np.random.default_rng(0).random(len(faces)) < 0.5
    faces[chosen] = faces[chosen][:, ::-1]
    sign = outward_signs(faces, sphere.vertices[faces])
    expected = outward_signs(sphere.faces, sphere.vertices[sphere.faces])
    np.testing.assert_array_equal(sign, np.where(chosen, -expected, expected))
    assert (expected[: len(expected) // 2] == 1).all()
    assert (expected[len(expected) // 2 :] == -1).all()


@pytest.mark.parametrize("turned", [False, True])
def test_thickness_and_curvature_of_a_sphere(turned):
    sphere = icosphere(4)
    surface = prepare_surface(TriangleMesh(sphere.vertices, sphere.faces[:, ::-1]) if turned else sphere)
    flows = Flows(surface.mesh)
    normals = Normals(surface, flows).over(FINE)
    radius = 1 / np.sqrt(AREA_OF_UNIT_SPHERE)
    np.testing.assert_allclose(np.exp(log_thickness(surface, normals, flows)) - 0.003, radius, rtol=0.05)
    np.testing.assert_allclose(curvature_across(surface, normals, adjacency_of(surface)), 1 / radius, rtol=0.15)


def test_a_sheet_is_thin_on_a_coarse_mesh():
    sphere = icosphere(3)
    sheet = TriangleMesh(sphere.vertices * (1, 1, 0.02), sphere.faces)
    surface = prepare_surface(sheet)
    flows = Flows(surface.mesh)
    normals = Normals(surface, flows).over(FINE)
    thickness = np.exp(log_thickness(surface, normals, flows)) - 0.003
    middle = np.hypot(*sheet.vertices[:, :2].T) < 0.6
    assert np.median(thickness[middle]) * np.sqrt(sheet.area) < 0.03


def test_border_weights_are_least_in_a_crease():
    # Two merged balls with a crease at x = 0.
    sphere = icosphere(4)
    x = sphere.vertices[:, 0]
    pushed = sphere.vertices + np.outer(np.sign(x) * 0.6 * np.exp(-((x / 0.5) ** 2) / 2), (1, 0, 0))
    waist = TriangleMesh(
        pushed * np.stack([np.ones_like(x), *[1 - 0.5 * np.exp(-((x / 0.2) ** 2))] * 2], axis=1), sphere.faces
    )
    surface = prepare_surface(waist)
    adjacency = adjacency_of(surface)
    flows = Flows(surface.mesh)
    shape = border_shape(surface, adjacency, flows, Normals(surface, flows))
    weights = weights_of_borders(adjacency.pairs, waist.unit_face_centers, shape.coarse, shape.thickness)
    place = np.abs(waist.face_centers[adjacency.pairs].mean(axis=1)[:, 0])
    assert (weights > 0).all()
    assert np.median(weights[place < 0.3]) < 0.5 * np.median(weights[place > 1.0])
