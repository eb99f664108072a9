import numpy as np
import pytest
from shapes import creature, icosphere, together

from wks_segment.core import PoseSegmentation, TriangleMesh, prepare_surface
from wks_segment.core.parts import normalized_cut, parts
from wks_segment.core.regions import FaceAdjacency, connected_regions
from wks_segment.core.shape import FINE, curvature_across, log_thickness, outward, smooth_normals, vertex_normals

AREA_OF_UNIT_SPHERE = 4 * np.pi


def adjacency_of(surface):
    return FaceAdjacency.of(surface.welded_faces, surface.original.vertices)


def dumbbell(rings=60, around=40):
    """Two balls of radius 1 that are grown together by a neck of radius 0.35."""
    x = -2 * np.cos(np.linspace(0, np.pi, rings + 2))[1:-1]
    radius = np.maximum(np.sqrt(np.maximum(1 - (np.abs(x) - 1) ** 2, 0)), np.where(np.abs(x) < 1, 0.35, 0))
    turn = np.linspace(0, 2 * np.pi, around, endpoint=False)
    y, z = np.outer(radius, np.cos(turn)), np.outer(radius, np.sin(turn))
    tube = np.stack([np.repeat(x, around), y.ravel(), z.ravel()])
    faces = []
    for i in range(rings - 1):
        a, b = i * around + np.arange(around), i * around + (np.arange(around) + 1) % around
        faces += [np.stack([a, b, b + around], axis=1), np.stack([a, b + around, a + around], axis=1)]
    first, last = np.arange(around), (rings - 1) * around + np.arange(around)
    poles = rings * around, rings * around + 1
    faces.append(np.stack([np.full(around, poles[0]), np.roll(first, -1), first], axis=1))
    faces.append(np.stack([np.full(around, poles[1]), last, np.roll(last, -1)], axis=1))
    return TriangleMesh(np.concatenate([tube.T, [(-2, 0, 0), (2, 0, 0)]]), np.concatenate(faces))


def test_faces_turn_outward_however_they_come():
    sphere = together(icosphere(2), TriangleMesh(icosphere(2).vertices + 5, icosphere(2).faces[:, ::-1]))
    faces = sphere.faces.copy()
    chosen = np.random.default_rng(0).random(len(faces)) < 0.5
    faces[chosen] = faces[chosen][:, ::-1]
    sign = outward(faces, sphere.vertices[faces])
    expected = outward(sphere.faces, sphere.vertices[sphere.faces])
    np.testing.assert_array_equal(sign, np.where(chosen, -expected, expected))
    assert (expected[: len(expected) // 2] == 1).all()
    assert (expected[len(expected) // 2 :] == -1).all()


@pytest.mark.parametrize("turned", [False, True])
def test_a_sphere_is_as_thick_and_as_curved_as_its_radius(turned):
    sphere = icosphere(4)
    surface = prepare_surface(TriangleMesh(sphere.vertices, sphere.faces[:, ::-1]) if turned else sphere)
    normals = smooth_normals(surface, vertex_normals(surface), FINE)
    radius = 1 / np.sqrt(AREA_OF_UNIT_SPHERE)
    np.testing.assert_allclose(np.exp(log_thickness(surface, normals)) - 0.003, radius, rtol=0.05)
    np.testing.assert_allclose(curvature_across(surface, normals, adjacency_of(surface)), 1 / radius, rtol=0.15)


def test_a_sheet_is_thin_on_a_coarse_mesh_too():
    sphere = icosphere(3)
    sheet = TriangleMesh(sphere.vertices * (1, 1, 0.02), sphere.faces)
    surface = prepare_surface(sheet)
    normals = smooth_normals(surface, vertex_normals(surface), FINE)
    thickness = np.exp(log_thickness(surface, normals)) - 0.003
    middle = np.hypot(*sheet.vertices[:, :2].T) < 0.6
    assert np.median(thickness[middle]) * np.sqrt(sheet.area) < 0.03


def test_patches_grow_together_across_what_is_not_a_border():
    # Six squares in a row; between the third and the fourth a crease.
    adjacency = FaceAdjacency(np.stack([np.arange(5), np.arange(1, 6)], axis=1), np.full(5, 0.4))
    weights = np.array([1, 1, 0.01, 1, 1])
    areas = np.full(6, 1 / 6)
    np.testing.assert_array_equal(normalized_cut(np.arange(6), areas, adjacency, weights, 0.1), [0, 0, 0, 1, 1, 1])
    assert normalized_cut(np.arange(6), areas, adjacency, weights, 0.0).max() == 0
    assert normalized_cut(np.arange(6), areas, adjacency, weights, 100.0).max() == 5


def test_thousands_of_loose_patches_are_no_table_of_all_with_all():
    # 20,000 pairs of patches, each pair by itself: all with all would be 12 GB.
    n = 20_000
    pairs = np.arange(2 * n).reshape(n, 2)
    adjacency = FaceAdjacency(pairs, np.full(n, 0.01))
    weights = np.where(np.arange(n) % 2, 1.0, 0.0)
    found = normalized_cut(np.arange(2 * n), np.full(2 * n, 1 / (2 * n)), adjacency, weights, 10.0)
    together = found[pairs[:, 0]] == found[pairs[:, 1]]
    np.testing.assert_array_equal(together, weights > 0)
    assert len(np.unique(found)) == 2 * n - np.count_nonzero(together)


def test_a_dumbbell_has_two_parts_that_meet_at_its_neck():
    surface = prepare_surface(dumbbell())
    part = parts(surface, np.zeros(surface.original.n_faces, dtype=int), adjacency_of(surface))
    x = surface.original.vertices[surface.original.faces].mean(axis=1)[:, 0]
    left, right = np.unique(part[x < -0.3]), np.unique(part[x > 0.3])
    # In the crease itself crumbs are left, for `merge_crumbs`.
    assert len(left) == len(right) == 1
    assert left != right


def test_parts_are_connected_and_loose_ones_stay_apart():
    mesh = together(creature(0.3, 4), TriangleMesh(icosphere(2).vertices + 9, icosphere(2).faces))
    model = PoseSegmentation(4, n_eigenpairs=60, n_energies=40, pieces="separate").fit([mesh])
    regions = model.segment_regions(mesh)
    surface = prepare_surface(mesh)
    np.testing.assert_array_equal(np.unique(regions), np.arange(regions.max() + 1))
    assert connected_regions(regions, adjacency_of(surface)).max() == regions.max()
    ball = np.arange(mesh.n_faces) >= creature(0.3, 4).n_faces
    assert not set(regions[ball]) & set(regions[~ball])


def test_without_smoothing_regions_are_those_of_the_components():
    mesh = creature(0.3, 4)
    model = PoseSegmentation(4, n_eigenpairs=60, n_energies=40, preset="paper").fit([mesh])
    expected = connected_regions(model.segment_faces(mesh), adjacency_of(prepare_surface(mesh)))
    np.testing.assert_array_equal(model.segment_regions(mesh), expected)
