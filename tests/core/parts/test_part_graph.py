from functools import cache

import numpy as np
import pytest
from shapes import figure, icosphere, together

from wks_segment.core import PoseSegmentation, TriangleMesh
from wks_segment.core.parts.evidence import Evidence
from wks_segment.core.parts.kinds import LEAST_REGION, grow
from wks_segment.core.parts.part_graph import TOGETHER, PartGraph
from wks_segment.core.poses.pose_cache import Workpiece
from wks_segment.core.progress import Progress


@cache
def evidence_of(*poses):
    described = PoseSegmentation(n_eigenpairs=30, n_energies=10).describe_all(poses)
    return Evidence.of([Workpiece(pose) for pose in described], None, Progress())


def mean_signature(evidence):
    """(m, d) signature of the faces, mean over the poses."""
    return np.mean([pose.surface.to_faces(pose.signature) for pose in evidence.poses], axis=0)


def graph_of(*poses):
    evidence = evidence_of(*poses)
    return PartGraph.of(evidence, mean_signature(evidence))


@cache
def dumbbell(subdivisions=3):
    """Two balls along x with a thin bar between them."""
    sphere = icosphere(subdivisions)
    x = sphere.vertices[:, 0]
    apart = sphere.vertices + np.outer(np.sign(x) * 1.2 * np.minimum(np.abs(x) / 0.35, 1), (1, 0, 0))
    waist = 1 - 0.75 * np.exp(-((x / 0.3) ** 4))
    return TriangleMesh(apart * np.stack([np.ones_like(x), waist, waist], axis=1), sphere.faces)


@cache
def sausage(bend=0.0):
    """Long ellipsoid along x, bent by an angle about z in its middle."""
    sphere = icosphere(2)
    x, y, z = (sphere.vertices * (4, 1, 1)).T
    turn = bend * np.clip(x / 0.6, 0, 1)
    bent = np.stack([x * np.cos(turn) - y * np.sin(turn), x * np.sin(turn) + y * np.cos(turn), z], axis=1)
    return TriangleMesh(bent, sphere.faces)


def borders(graph):
    """Pairs of regions that touch."""
    return np.nonzero(np.triu(np.isfinite(graph.likeness), 1))


def places(graph, mesh):
    """Distance of each border between faces from the plane x = 0; each face must be a region."""
    first, second = borders(graph)
    x = mesh.face_centers[np.argsort(graph.patch), 0]
    return (np.abs(x[first]) + np.abs(x[second])) / 2


def check(graph):
    """What holds before and after any number of merges."""
    regions = graph.regions
    np.testing.assert_array_equal(np.unique(graph.region_of_faces()), regions)
    for table in (graph.likeness, graph.lengths, graph.weighted, graph.concavities, graph.sights):
        np.testing.assert_allclose(table, table.T, rtol=1e-9)
    gone = ~graph.alive
    assert (graph.likeness[gone] == -np.inf).all()
    assert (graph.lengths[gone] == 0).all()
    assert (graph.likeness.diagonal() == -np.inf).all()
    np.testing.assert_array_equal(np.isfinite(graph.likeness), graph.lengths > 0)
    assert graph.areas[regions].sum() == pytest.approx(1)


def test_each_face_of_a_small_mesh_is_a_region_and_neighbors_share_an_edge():
    mesh = icosphere(2)
    graph = graph_of(mesh)
    check(graph)
    np.testing.assert_array_equal(np.sort(graph.region_of_faces()), np.arange(mesh.n_faces))
    assert len(borders(graph)[0]) == 1.5 * mesh.n_faces
    np.testing.assert_allclose(graph.areas[graph.patch], mesh.face_areas / mesh.area)


def test_a_merged_region_has_the_sums_of_both():
    graph = graph_of(sausage(), sausage(0.7))
    first, second = (int(i) for i in np.argwhere(np.isfinite(graph.likeness))[100])
    other = np.setdiff1d(np.arange(len(graph.alive)), [first, second])
    sums, tables = (
        ("areas", "thickness", "correlations", "signatures"),
        ("lengths", "weighted", "concavities", "sights"),
    )
    before = {name: getattr(graph, name).copy() for name in sums + tables}
    kept = graph.merge(first, second)
    assert kept == (first if before["areas"][first] >= before["areas"][second] else second)
    check(graph)
    for name in sums:
        np.testing.assert_allclose(getattr(graph, name)[kept], before[name][first] + before[name][second])
    for name in tables:
        expected = before[name][first] + before[name][second]
        np.testing.assert_allclose(getattr(graph, name)[kept, other], expected[other])
    assert graph.lengths[kept, kept] == 0
    assert set(graph.region_of_faces()[np.isin(graph.patch, [first, second])]) == {kept}
    np.testing.assert_allclose(
        graph.mean_signatures()[np.searchsorted(graph.regions, kept)], graph.signatures[kept] / graph.areas[kept]
    )


def test_likeness_after_merges_does_not_depend_on_their_order():
    graphs = [graph_of(sausage(), sausage(0.7)) for _ in range(2)]
    chosen = graphs[0].patch[sausage().face_centers[:, 0] > 2]
    for graph, order in zip(graphs, (chosen, chosen[::-1]), strict=True):
        region = int(order[0])
        for other in order[1:]:
            region = graph.merge(region, int(other))
        check(graph)
    outside = np.setdiff1d(np.arange(320), chosen)
    rows = [graph.likeness[graph.owner[chosen[0]], outside] for graph in graphs]
    np.testing.assert_allclose(rows[0], rows[1], rtol=1e-4)


def test_likeness_is_low_across_the_neck_of_a_dumbbell():
    mesh = dumbbell(2)
    graph = graph_of(mesh)
    place, likeness = places(graph, mesh), graph.likeness[borders(graph)]
    # The bar joins the ball where its radius changes.
    assert np.median(likeness[place < 1.2]) < np.median(likeness[place > 1.6]) - 0.5


def test_likeness_is_low_where_something_bends_and_high_where_it_moves_as_one():
    mesh = sausage()
    still, moving = graph_of(mesh, mesh), graph_of(mesh, sausage(1.0))
    place = places(still, mesh)
    lost = still.likeness[borders(still)] - moving.likeness[borders(still)]
    assert lost[place < 0.4].mean() > 1
    # Half of the sausage turns apart from each end.
    assert -0.7 * TOGETHER < np.median(lost[place > 1.5]) < -0.4 * TOGETHER


def test_a_mesh_that_moves_as_a_whole_has_the_likeness_of_one_pose():
    mesh = dumbbell(2)
    moved = TriangleMesh(mesh.vertices[:, [1, 2, 0]] + (3, 2, 1), mesh.faces)
    expected, found = graph_of(mesh), graph_of(mesh, moved)
    np.testing.assert_allclose(found.likeness, expected.likeness, atol=0.01)


@pytest.mark.parametrize("seed", range(2))
def test_the_order_of_faces_does_not_matter(seed):
    mesh, posed = sausage(0.2), sausage(0.7)
    order = np.random.default_rng(seed).permutation(mesh.n_faces)
    before = graph_of(mesh, posed)
    after = graph_of(*(TriangleMesh(pose.vertices, pose.faces[order]) for pose in (mesh, posed)))
    found, expected = (
        graph.likeness[np.ix_(patch, patch)] for graph, patch in ((after, after.patch), (before, before.patch[order]))
    )
    np.testing.assert_allclose(found, expected, rtol=1e-3)


def test_the_size_of_the_mesh_does_not_matter():
    mesh = dumbbell(2)
    large = TriangleMesh(1e3 * mesh.vertices, mesh.faces)
    np.testing.assert_allclose(graph_of(large).likeness, graph_of(mesh).likeness, atol=1e-4)


def test_a_dumbbell_grows_into_two_balls_and_a_bar():
    mesh = dumbbell()
    graph = graph_of(mesh)
    grow(graph, 0.0, 60)
    check(graph)
    region, x = graph.region_of_faces(), mesh.face_centers[:, 0]
    balls = [np.unique(region[side * x > 1.4]) for side in (-1, 1)]
    assert len(balls[0]) == len(balls[1]) == 1
    assert balls[0] != balls[1]
    assert len(graph.regions) in (2, 3)
    np.testing.assert_allclose(graph.areas[np.concatenate(balls)], 0.45, atol=0.06)


def test_a_mesh_grows_into_one_part_if_nothing_is_too_unlikely():
    graph = graph_of(dumbbell(2))
    grow(graph, -np.inf, 60)
    check(graph)
    assert len(graph.regions) == 1


def test_regions_stay_few_enough_and_large_enough():
    graph = graph_of(icosphere(2))
    grow(graph, np.inf, 30)
    check(graph)
    assert 1 < len(graph.regions) <= 30
    graph = graph_of(dumbbell())
    grow(graph, np.inf, 1_000)
    check(graph)
    assert len(graph.regions) > 60
    assert graph.areas[graph.regions].min() >= LEAST_REGION


def test_fewer_and_larger_regions_are_left_at_a_lower_limit():
    numbers = []
    body = figure(subdivisions=2)
    for least in (3.0, 1.0, -1.0, -3.0):
        graph = graph_of(body)
        grow(graph, least, 1_000)
        numbers.append(len(graph.regions))
    assert numbers == sorted(numbers, reverse=True)
    assert numbers[0] > numbers[-1]


def test_separate_islands_are_never_merged():
    ball = icosphere(1)
    model = PoseSegmentation(n_eigenpairs=40, n_energies=10, pieces="separate")
    both = together(ball, TriangleMesh(ball.vertices + (4, 0, 0), ball.faces))
    evidence = Evidence.of([Workpiece(model.describe(both))], None, Progress())
    graph = PartGraph.of(evidence, mean_signature(evidence))
    grow(graph, -np.inf, 1)
    assert len(graph.regions) == 2
    assert len(np.unique(graph.region_of_faces()[: ball.n_faces])) == 1
