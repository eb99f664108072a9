import numpy as np
from shapes import creature, grid, icosphere, together

from wks_segment.core import TriangleMesh
from wks_segment.core.mesh.adjacency import FaceAdjacency, FaceGraph, connected_regions, merge_small_regions


def adjacency_of(mesh):
    return FaceAdjacency.of(mesh.faces, mesh.vertices)


def graph_of(mesh):
    return FaceGraph(mesh.face_areas, mesh.face_centers, adjacency_of(mesh))


def test_each_edge_of_a_closed_surface_has_two_neighbors():
    mesh = icosphere(2)
    adjacency = adjacency_of(mesh)
    assert len(adjacency.pairs) == 3 * mesh.n_faces // 2
    shared = [len(set(mesh.faces[a]) & set(mesh.faces[b])) for a, b in adjacency.pairs]
    assert set(shared) == {2}


def test_three_faces_at_one_edge_are_connected():
    vertices = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1)]
    faces = np.array([(0, 1, 2), (0, 1, 3), (0, 1, 4)])
    regions = connected_regions(np.zeros(3, int), FaceAdjacency.of(faces, np.array(vertices, float)))
    assert regions.tolist() == [0, 0, 0]


def test_regions_are_connected_and_numbered_by_label():
    mesh = grid(10, 2)
    labels = (mesh.face_centers[:, 0] * 5).astype(int) % 2
    regions = connected_regions(labels, adjacency_of(mesh))
    assert regions.max() + 1 == 5
    assert [int(labels[regions == r][0]) for r in range(5)] == [0, 0, 0, 1, 1]


def test_a_small_region_joins_the_neighbor_with_the_longest_border():
    mesh = grid(20, 20)
    x, y = mesh.face_centers[:, :2].T
    labels = (x > 0.5).astype(int)
    small = (abs(x - 0.2) < 0.05) & (abs(y - 0.5) < 0.05)
    labels[small] = 2
    cleaned, _ = merge_small_regions(labels, graph_of(mesh), 0.05)
    assert set(cleaned) == {0, 1}
    assert (cleaned[small] == 0).all()
    np.testing.assert_array_equal(cleaned[~small], labels[~small])


def test_a_band_that_is_small_compared_with_its_label_joins_a_neighbor():
    mesh = grid(40, 10)
    x = mesh.face_centers[:, 0]
    labels = np.where(x < 0.4, 0, np.where(x < 0.45, 2, np.where(x < 0.65, 1, 2)))
    band = (labels == 2) & (x < 0.5)
    for min_share_of_largest, expected in ((0.1, {2}), (0.2, {0, 1})):
        cleaned, _ = merge_small_regions(labels, graph_of(mesh), 0.005, min_share_of_largest)
        assert set(cleaned[band]) <= expected
        np.testing.assert_array_equal(cleaned[~band], labels[~band])


def test_of_two_adjacent_bands_neither_keeps_the_other():
    mesh = grid(100, 10)
    x = mesh.face_centers[:, 0] * 100
    labels = np.select([x < 30, x < 32, x < 34.5, x < 55, x < 75], [0, 2, 3, 1, 2], 3)
    bands = (x > 30) & (x < 34.5)
    cleaned, _ = merge_small_regions(labels, graph_of(mesh), 0.005, 0.15)
    assert set(cleaned[bands]) <= {0, 1}
    np.testing.assert_array_equal(cleaned[~bands], labels[~bands])


def test_after_merging_no_region_is_too_small_and_large_ones_keep_their_label():
    mesh = creature(0.2)
    labels = np.random.default_rng(0).integers(0, 5, mesh.n_faces)
    labels[mesh.face_centers[:, 0] > 0] = 3
    adjacency = adjacency_of(mesh)
    cleaned, _ = merge_small_regions(labels, graph_of(mesh), 0.005)
    sizes = np.bincount(connected_regions(cleaned, adjacency), weights=mesh.face_areas)
    assert sizes.min() >= 0.005 * mesh.area
    assert (cleaned[mesh.face_centers[:, 0] > 0] == 3).all()


def test_a_small_island_takes_the_label_of_the_nearest_face():
    big, eye = icosphere(3), icosphere(1)
    mesh = together(big, TriangleMesh(0.02 * eye.vertices + (1.03, 0, 0), eye.faces))
    labels = (mesh.face_centers[:, 0] > 0).astype(int)
    labels[big.n_faces :] = 7
    cleaned, _ = merge_small_regions(labels, graph_of(mesh), 0.005)
    assert set(cleaned[big.n_faces :]) == {1}


def test_labels_stay_if_every_region_is_too_small():
    mesh = together(*[TriangleMesh(icosphere(1).vertices + 3 * i, icosphere(1).faces) for i in range(4)])
    labels = np.arange(mesh.n_faces) // icosphere(1).n_faces
    cleaned, _ = merge_small_regions(labels, graph_of(mesh), 0.9)
    np.testing.assert_array_equal(cleaned, labels)
