"""Spikes and small holes are repaired, and nothing else changes."""

import numpy as np
import pytest
from shapes import creature, figure, grid, icosphere

from wks_segment.core import PoseSegmentation, TriangleMesh, prepare_surface
from wks_segment.core.mesh.repair import caps_of_small_holes, without_spikes


def without_faces_near(mesh, vertex, radius):
    centers = mesh.face_centers
    return TriangleMesh(mesh.vertices, mesh.faces[np.linalg.norm(centers - mesh.vertices[vertex], axis=1) > radius])


@pytest.mark.parametrize("seed", range(3))
def test_spikes_are_moved_back_and_other_vertices_stay(seed):
    mesh = creature(0.2, 4)
    generator = np.random.default_rng(seed)
    displaced = generator.choice(mesh.n_vertices, 25, replace=False)
    vertices = mesh.vertices.copy()
    vertices[displaced] += 1.5 * generator.standard_normal((25, 3))
    far = np.linalg.norm(vertices - mesh.vertices, axis=1) > 0.8
    repaired = without_spikes(vertices, mesh.faces)
    assert far.sum() > 20
    assert np.linalg.norm(repaired - mesh.vertices, axis=1)[far].max() < 0.25
    unmoved = np.setdiff1d(np.arange(mesh.n_vertices), displaced)
    np.testing.assert_array_equal(repaired[unmoved], mesh.vertices[unmoved])


def test_tips_of_horns_and_limbs_stay():
    # A horn of one ring of long triangles on a coarse head, as in low-poly models.
    ring = [(np.cos(a), np.sin(a), 0) for a in np.arange(6) * np.pi / 3]
    vertices = np.array([*ring, (0, 0, 3.0), (0, 0, -1.0)])
    faces = np.array([(i, (i + 1) % 6, 6) for i in range(6)] + [(i, (i + 1) % 6, 7) for i in range(6)])
    np.testing.assert_array_equal(without_spikes(vertices, faces), vertices)
    for mesh in (icosphere(3), creature(0.5, 4), grid(10, 10)):
        np.testing.assert_array_equal(without_spikes(mesh.vertices, mesh.faces), mesh.vertices)


def test_a_small_hole_is_closed_by_a_cap():
    whole = icosphere(4)
    open_ = without_faces_near(whole, 0, 0.2)
    vertices, faces = caps_of_small_holes(open_)
    closed = TriangleMesh(np.concatenate([open_.vertices, vertices]), np.concatenate([open_.faces, faces]))
    # The cap is flat, the sphere is not.
    assert closed.area == pytest.approx(whole.area, rel=0.002)
    assert not len(caps_of_small_holes(closed)[1])


def test_large_openings_and_flat_sheets_stay_open():
    for mesh in (grid(8, 8), without_faces_near(icosphere(4), 0, 0.8)):
        vertices, faces = caps_of_small_holes(mesh)
        assert (len(vertices), len(faces)) == (0, 0)


def test_holes_that_share_a_vertex_stay_open():
    mesh = icosphere(4)
    at = [face for face in range(mesh.n_faces) if 0 in mesh.faces[face]]
    bow_tie = TriangleMesh(mesh.vertices, np.delete(mesh.faces, [at[0], at[3]], axis=0))
    assert not len(caps_of_small_holes(bow_tie)[1])


def test_a_cap_belongs_to_no_original_face():
    open_ = without_faces_near(creature(0.0, 4), 100, 0.15)
    surface = prepare_surface(open_, 4000)
    assert (surface.face_of == -1).any()
    values = np.random.default_rng(0).random((surface.mesh.n_vertices, 2))
    assert surface.to_faces(values).shape == (open_.n_faces, 2)
    assert np.isfinite(surface.to_faces(values)).all()


def test_labels_survive_spikes_and_holes():
    poses = [figure(0.0, 0.0), figure(0.5, 0.1), figure(-0.3, 0.6)]
    model = PoseSegmentation(4, n_eigenpairs=60, n_energies=40).fit(poses)
    clean = figure(0.25, 0.25)
    expected = model.segment_faces(clean)
    generator = np.random.default_rng(0)
    vertices = clean.vertices.copy()
    displaced = generator.choice(clean.n_vertices, clean.n_vertices // 100, replace=False)
    vertices[displaced] += generator.standard_normal((len(displaced), 3))
    spiky = model.segment_faces(TriangleMesh(vertices, clean.faces))
    assert np.average(spiky == expected, weights=clean.face_areas) > 0.97
    kept = np.linalg.norm(clean.face_centers - clean.vertices[100], axis=1) > 0.15
    holed = model.segment_faces(TriangleMesh(clean.vertices, clean.faces[kept]))
    assert np.average(holed == expected[kept], weights=clean.face_areas[kept]) > 0.97
