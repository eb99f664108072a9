from itertools import product

import numpy as np
import pytest
from shapes import creature, grid, icosphere, together

from wks_segment.core import TriangleMesh, prepare_surface
from wks_segment.core.geometry.creases import COARSE, Normals, curvature_across
from wks_segment.core.geometry.graph_cut import CutStyle, Energy, cut_borders, expansion, minimize_energy
from wks_segment.core.geometry.heat_flow import Flows
from wks_segment.core.mesh.adjacency import FaceAdjacency, FaceGraph

LENGTH = 0.08


def adjacency_of(mesh):
    return FaceAdjacency.of(mesh.faces, mesh.vertices)


def random_energy(random, n, count):
    """Energy with random costs on n nodes, in which pairs occur several times."""
    pairs = random.integers(0, n, (2 * n, 2))
    pairs = pairs[pairs[:, 0] != pairs[:, 1]]
    return Energy.of(random.random((n, count)), pairs, random.random(len(pairs)))


def split_at(mesh, x, blur=LENGTH):
    """Posteriors of two labels that meet where the first coordinate is x, as if smoothed over a length."""
    share = 1 / (1 + np.exp(2 * (mesh.face_centers[:, 0] - x) / blur))
    return np.stack([share, 1 - share], axis=1)


def cut(mesh, posteriors, weights=None, labels=None, **style):
    graph = FaceGraph(mesh.face_areas, mesh.face_centers, adjacency_of(mesh))
    weights = np.ones(len(graph.adjacency.pairs)) if weights is None else weights
    return cut_borders(posteriors, graph, weights, CutStyle(LENGTH, **style), labels)


def at_line(mesh, x):
    """Whether the line where the first coordinate is x separates each pair of neighbors."""
    side = mesh.face_centers[adjacency_of(mesh).pairs, 0] > x
    return side[:, 0] != side[:, 1]


@pytest.mark.parametrize("seed", range(20))
def test_two_labels_reach_the_minimum_that_brute_force_finds(seed):
    random = np.random.default_rng(seed)
    energy = random_energy(random, 9, 2)
    found = minimize_energy(energy, random.integers(0, 2, 9), np.ones((9, 2), dtype=bool))
    assert energy.at(found) == min(energy.at(np.array(labels)) for labels in product(range(2), repeat=9))


@pytest.mark.parametrize("seed", range(20))
def test_an_expansion_is_the_best_of_all_moves(seed):
    random = np.random.default_rng(seed)
    energy, labels = random_energy(random, 9, 4), random.integers(0, 4, 9)
    nodes = np.flatnonzero((labels != 2) & (random.random(9) < 0.8))
    switching = expansion(energy, labels, 2, nodes, np.arange(len(energy.pairs)))
    assert set(switching) <= set(nodes)
    tried = []
    for chosen in product([False, True], repeat=len(nodes)):
        tried.append(labels.copy())
        tried[-1][nodes[np.array(chosen, dtype=bool)]] = 2
    found = labels.copy()
    found[switching] = 2
    assert energy.at(found) == min(map(energy.at, tried))


@pytest.mark.parametrize("seed", range(10))
def test_the_energy_never_rises_and_the_result_is_deterministic(seed):
    random = np.random.default_rng(seed)
    energy, labels = random_energy(random, 300, 6), random.integers(0, 6, 300)
    allowed = random.random((300, 6)) < 0.5
    so_far = energy.at(labels)
    moving = labels.copy()
    for label in [*range(6), *range(6)]:
        nodes = np.flatnonzero(allowed[:, label] & (moving != label))
        switching = expansion(energy, moving, label, nodes, np.arange(len(energy.pairs)))
        moving[switching] = label
        assert energy.at(moving) <= so_far - len(switching[:1])
        so_far = energy.at(moving)
    found = minimize_energy(energy, labels, allowed)
    so_far = energy.at(found)
    assert so_far < energy.at(labels)
    assert (allowed[np.arange(300), found] | (found == labels)).all()
    np.testing.assert_array_equal(minimize_energy(energy, labels, allowed), found)
    # No expansion of a single label lowers the energy further, the labels at the start included.
    allowed[np.arange(300), labels] = True
    for label in range(6):
        nodes = np.flatnonzero(allowed[:, label] & (found != label))
        assert not len(expansion(energy, found, label, nodes, np.arange(len(energy.pairs))))


def test_costs_of_any_size_fit_into_32_bits():
    pairs = np.array([(0, 1), (1, 2)])
    for size in (0.0, 1e-300, 1e-9, 1e12):
        energy = Energy.of(size * np.array([[0, 1], [1, 0], [0, 3.0]]), pairs, size * np.array([5.0, 0.5]))
        assert energy.data.max() + 2 * energy.borders.sum() < 2**31
        found = minimize_energy(energy, np.array([0, 1, 1]), np.ones((3, 2), dtype=bool))
        assert found.tolist() == ([0, 1, 1] if size < 1e-200 else [0, 0, 0])


def test_a_border_snaps_to_a_nearby_marked_edge():
    mesh = grid(60, 60)
    near, far = at_line(mesh, 0.55), at_line(mesh, 0.8)
    marked = cut(mesh, split_at(mesh, 0.5), np.where(near | far, 0.1, 1.0))
    np.testing.assert_array_equal(marked, mesh.face_centers[:, 0] > 0.55)
    out_of_reach = cut(mesh, split_at(mesh, 0.5), np.where(far, 0.1, 1.0))
    np.testing.assert_array_equal(out_of_reach, mesh.face_centers[:, 0] > 0.5)


def test_a_border_snaps_to_a_nearby_crease():
    sphere = icosphere(5)
    x = sphere.vertices[:, 0]
    waist = 1 - 0.1 * np.exp(-((x / 0.1) ** 2))
    mesh = TriangleMesh(sphere.vertices * np.stack([np.ones_like(x), waist, waist], axis=1), sphere.faces)
    surface = prepare_surface(mesh)
    normals = Normals(surface, Flows(surface.mesh)).over(COARSE)
    curvature = curvature_across(surface, normals, adjacency_of(mesh))
    weights = CutStyle(LENGTH).border_weights(curvature)
    across = at_line(mesh, 0.0)
    assert weights[across].max() < 0.6
    assert weights.max() <= 1
    posteriors = split_at(mesh, 0.12, LENGTH * np.sqrt(mesh.area))
    found = cut(mesh, posteriors, weights, strength=2.0)
    in_crease = np.abs(mesh.face_centers[:, 0]) < 0.08
    np.testing.assert_array_equal(found[~in_crease], mesh.face_centers[~in_crease, 0] > 0)
    assert (posteriors.argmax(axis=1) != found)[~in_crease].any()


def test_a_node_can_go_back_to_its_first_label():
    # An expansion of the first label takes a node that is better off with the second one after a later expansion.
    data = np.array([(0.0, 9), (1, 1.2), (1, 1.2), (9, 0)])
    energy = Energy.of(data, np.array([(0, 1), (1, 2), (2, 3)]), np.array([0.1, 1.0, 0.5]))
    for start in ([0, 0, 1, 1], [0, 1, 1, 1], [0, 0, 0, 1]):
        found = minimize_energy(energy, np.array(start), np.ones((4, 2), dtype=bool))
        allowed = np.ones((4, 2), dtype=bool)
        allowed[np.arange(4), start] = False
        np.testing.assert_array_equal(minimize_energy(energy, np.array(start), allowed), found)


def test_a_jagged_border_becomes_short():
    mesh = grid(60, 60)
    x, y = mesh.face_centers[:, :2].T
    jagged = split_at(mesh, 0.5 + 0.04 * np.sign(np.sin(40 * y)))
    found = cut(mesh, jagged, strength=1.0)
    adjacency = adjacency_of(mesh)

    def length(labels):
        return adjacency.lengths[labels[adjacency.pairs[:, 0]] != labels[adjacency.pairs[:, 1]]].sum()

    assert length(found) < 1.2 < 1.5 < length(jagged.argmax(axis=1))
    assert (found[abs(x - 0.5) > 0.05] == (x > 0.5)[abs(x - 0.5) > 0.05]).all()


def test_labels_change_only_in_the_band_and_only_to_labels_nearby():
    mesh = grid(50, 50)
    random = np.random.default_rng(0)
    x = mesh.face_centers[:, 0]
    posteriors = np.zeros((mesh.n_faces, 5))
    posteriors[np.arange(mesh.n_faces), np.where(x < 0.3, 0, np.where(x < 0.7, 1, 4))] = 0.2
    # A label that is almost as likely everywhere, but the likeliest nowhere, must not appear.
    posteriors[:, 2] = 0.19
    weights = random.random(len(adjacency_of(mesh).pairs))
    before = posteriors.argmax(axis=1)
    found = cut(mesh, posteriors, weights, strength=3.0)
    changed = found != before
    assert changed.any()
    assert set(found) == {0, 1, 4}
    assert (np.minimum(abs(x - 0.3), abs(x - 0.7))[changed] <= LENGTH).all()
    np.testing.assert_array_equal(cut(mesh, posteriors, weights, strength=3.0, width=0.01), before)


def test_the_scale_of_the_mesh_does_not_matter():
    mesh = creature(0.3, 4)
    x = mesh.face_centers[:, 0]
    posteriors = np.stack([np.exp(-((x - place) ** 2)) for place in (-1, 0, 1, 2)], axis=1)
    posteriors /= posteriors.sum(axis=1, keepdims=True)
    found = cut(mesh, posteriors)
    assert (found != posteriors.argmax(axis=1)).any()
    for scale in (1e-3, 1e3):
        scaled = cut(TriangleMesh(scale * mesh.vertices, mesh.faces), posteriors)
        assert (scaled == found).mean() > 0.999


def test_faces_without_a_label_stay_without_and_are_no_neighbors():
    mesh = grid(40, 40)
    before = (mesh.face_centers[:, 0] > 0.5).astype(int)
    before[np.random.default_rng(0).random(mesh.n_faces) < 0.1] = -1
    found = cut(mesh, split_at(mesh, 0.55), labels=before, strength=1.0)
    assert (found != before).any()
    np.testing.assert_array_equal(found == -1, before == -1)


def test_faces_without_neighbors_keep_their_labels():
    mesh = grid(4, 4)
    soup = TriangleMesh(mesh.vertices[mesh.faces].reshape(-1, 3), np.arange(3 * mesh.n_faces).reshape(-1, 3))
    posteriors = np.random.default_rng(0).dirichlet(np.ones(6), soup.n_faces)
    np.testing.assert_array_equal(cut(soup, posteriors), posteriors.argmax(axis=1))
    both = together(grid(30, 30), TriangleMesh(soup.vertices + 3, soup.faces))
    posteriors = np.concatenate([split_at(grid(30, 30), 0.5), np.tile([0.4, 0.6], (soup.n_faces, 1))])
    assert set(cut(both, posteriors, strength=2.0)[-soup.n_faces :]) == {1}


def test_a_single_face_and_polygons_that_share_several_edges():
    alone = TriangleMesh(np.eye(3), np.array([(0, 1, 2)]))
    assert cut(alone, np.array([[0.3, 0.7]])).tolist() == [1]
    # The middle polygon shares two edges with the left one and one edge with the right one.
    pairs = FaceAdjacency(np.array([(0, 1), (1, 0), (1, 2)]), np.ones(3))
    posteriors = np.array([[0.9, 0.1], [0.45, 0.55], [0.1, 0.9]])
    centers = np.array([(0, 0, 0), (1, 0, 0), (2, 0, 0)])
    graph = FaceGraph(np.ones(3), centers, pairs)
    found = cut_borders(posteriors, graph, np.ones(3), CutStyle(1.0, strength=0.5))
    assert found.tolist() == [0, 0, 1]


def test_a_negative_weight_is_an_error():
    mesh = grid(2, 2)
    with pytest.raises(ValueError, match="negative"):
        cut(mesh, split_at(mesh, 0.5), np.full(len(adjacency_of(mesh).pairs), -1.0))
