"""A mixture whose components are the signatures inside kinds of parts."""

import numpy as np
import pytest
from shapes import creature, figure, icosphere, places_on

from wks_segment.core import MemoryCache, PoseSegmentation
from wks_segment.core.learning import inside_parts, part_mixture
from wks_segment.core.learning.agreement import PER_KIND
from wks_segment.core.learning.part_mixture import (
    COMPONENTS_OF_MESH,
    COMPONENTS_OF_POSE,
    PER_SEGMENT,
    VANISHED,
)
from wks_segment.core.learning.standardizer import Standardizer
from wks_segment.core.learning.training_samples import TrainingSamples
from wks_segment.core.parts.kinds import Kinds
from wks_segment.core.poses.pose_cache import Workpiece

SMALL = {"n_segments": 4, "n_eigenpairs": 40, "n_energies": 20}
POSES = [figure(0.0, 0.0, 3), figure(0.4, -0.1, 3)]
BODIES = [figure(0.0, 0.0, 2), creature(0.2, 2, seed=0)]


class Recording(MemoryCache):
    """Cache that remembers the kinds that are added to it."""

    kinds: Kinds

    def keep(self, key, arrays):
        found = Kinds.of_arrays(arrays)
        if found is not None:
            self.kinds = found
        super().keep(key, arrays)


@pytest.fixture(scope="module")
def learned():
    """Model of the poses of one mesh, and the kinds of parts that it is about."""
    cache = Recording()
    return PoseSegmentation(**SMALL).fit(POSES, cache=cache), cache.kinds


@pytest.fixture(scope="module")
def learned_bodies():
    """Model of two bodies, and their kinds of parts."""
    cache = Recording()
    return PoseSegmentation(**SMALL).fit(BODIES, cache=cache), cache.kinds


def test_groups_of_components_are_the_kinds_of_parts(learned):
    model, kinds = learned
    count = model.grouping_.n_kinds
    assert 4 < count <= kinds.count
    (of_faces,), mesh = kinds.of_faces, POSES[0]
    labels = model.with_segments(count).segment_polygons(POSES, [np.arange(mesh.n_faces)] * 2)
    shares = np.zeros((kinds.count, count))
    np.add.at(shares, (of_faces, labels), mesh.face_areas / mesh.area)
    # Most of each kind is in one group, and most of each group is of one kind.
    assert shares.max(axis=1).sum() > 0.5
    assert shares.max(axis=0).sum() > 0.5
    assert shares.sum(axis=0).max() < 0.5  # not because one group is nearly all


def test_kinds_are_no_bands_of_the_signature(learned):
    """Both arms are one kind and both legs another one, but head, tail and body are none of these."""
    _, kinds = learned
    (of_faces,), mesh = kinds.of_faces, POSES[0]
    ends = {"left arm": (1, 0, 0.3), "right arm": (-1, 0, 0.3), "left leg": (0.5, 0, -1), "right leg": (-0.5, 0, -1),
            "head": (0, 0, 1), "tail": (0, 0.9, -0.3)}  # fmt: skip
    kind = {name: of_faces[np.argmax(mesh.face_centers @ np.array(axis))] for name, axis in ends.items()}
    assert kind["left arm"] == kind["right arm"]
    assert kind["left leg"] == kind["right leg"]
    assert len({kind[name] for name in ("left arm", "left leg", "head", "tail")}) == 4


def test_one_mesh_has_a_tied_covariance(learned):
    model, _ = learned
    assert not model.of_bodies_
    assert model.mixture_.covariance_type == "tied"
    usual = min(COMPONENTS_OF_MESH, COMPONENTS_OF_POSE * len(POSES))
    assert 0.8 * usual < len(model.mixture_.weights) < 1.2 * usual
    assert model.mixture_.weights.sum() == pytest.approx(1)


def test_bodies_have_a_diagonal_covariance_each(learned_bodies):
    model, kinds = learned_bodies
    assert model.of_bodies_
    assert model.mixture_.covariance_type == "diag"
    assert 0.8 * PER_KIND * kinds.count < len(model.mixture_.weights) < 1.2 * PER_KIND * kinds.count
    assert model.grouping_.n_kinds <= kinds.count
    assert [len(of_faces) for of_faces in kinds.of_faces] == [mesh.n_faces for mesh in BODIES]


def test_models_of_bodies_rank_with_one_diagonal(learned, learned_bodies):
    model, _ = learned_bodies
    ranked = model._learned().for_ranking(model.mixture_)
    assert ranked.covariance_type == "shared"
    np.testing.assert_allclose(ranked.covariances, model.mixture_.weights @ model.mixture_.covariances)
    poses, _ = learned
    np.testing.assert_array_equal(
        poses._learned().for_ranking(poses.mixture_).covariances, np.diag(poses.mixture_.covariances)
    )


def test_more_segments_have_more_components():
    number = (COMPONENTS_OF_MESH + 30) // PER_SEGMENT
    model = PoseSegmentation(**SMALL | {"n_segments": number}).fit(POSES[:1])
    assert len(model.mixture_.weights) > 0.9 * PER_SEGMENT * number > 1.05 * COMPONENTS_OF_MESH
    assert model.predict_proba(POSES[0]).shape == (POSES[0].n_vertices, number)


def test_the_paper_has_a_component_for_each_segment():
    model = PoseSegmentation(**SMALL, preset="paper").fit(POSES[:1])
    assert len(model.mixture_.weights) == 4
    assert (model.grouping_, model.of_bodies_) == (None, False)


def test_too_few_distinct_signatures_for_the_segments_are_refused():
    """With full matrices there is one component for each kind of a ball, which has few."""
    with pytest.raises(ValueError, match="30 components are too many: the samples have only"):
        PoseSegmentation(**SMALL | {"n_segments": 30, "covariance_type": "full"}).fit([icosphere(2)])


def test_rest_with_other_faces_is_refused():
    with pytest.raises(ValueError, match="rest has other faces than the first pose"):
        PoseSegmentation(**SMALL).fit(POSES[:1], rest=icosphere(2))


def training(samples, shares=None, order=None):
    """Training samples of one pose, each at a vertex of its own."""
    count, width = samples.shape
    shares = np.full(count, 1 / count) if shares is None else shares
    order = np.arange(count) if order is None else order
    standardizer = Standardizer("raw", np.zeros(width), np.ones(width))
    return TrainingSamples(
        samples[order], shares[order], np.zeros(count, dtype=int), np.arange(count), standardizer, samples[order]
    )


@pytest.fixture(scope="module")
def samples():
    """Samples along three axes, their shares, and the kind of each: the larger, the more samples; 1 has none."""
    generator = np.random.default_rng(0)
    kind = np.repeat([0, 2, 3], [640, 160, 40])
    shares = generator.random(840) + 0.5
    return generator.standard_normal((840, 3)) * (3, 2, 1), shares / shares.sum(), kind


@pytest.mark.parametrize("covariance_type", ["tied", "shared", "diag", "spherical"])
def test_each_component_has_samples_of_one_kind(samples, covariance_type):
    points, shares, kind = samples
    mixture, of_components = inside_parts.fitted_inside(training(points, shares), kind, np.eye(3), 28, covariance_type)
    assert set(of_components) == {0, 2, 3}
    # By the square root of the area: 25.3, 12.6 and 6.3 of 44.2.
    assert np.bincount(of_components).tolist() == [16, 0, 8, 4]
    for k in (0, 2, 3):
        weights, means = mixture.weights[of_components == k], mixture.means[of_components == k]
        assert weights.sum() == pytest.approx(shares[kind == k].sum())
        center = shares[kind == k] @ points[kind == k] / shares[kind == k].sum()
        np.testing.assert_allclose(weights @ means / weights.sum(), center, atol=1e-9)
        assert means.min() >= points[kind == k].min()
    # Samples of a cluster are near each other.
    distance = np.linalg.norm(points[:, None] - mixture.means, axis=2).min(axis=1)
    assert distance.mean() < 0.5 * np.linalg.norm(points, axis=1).mean()


def test_full_matrices_have_one_component_for_each_kind(samples):
    points, shares, kind = samples
    mixture, of_components = inside_parts.fitted_inside(training(points, shares), kind, np.eye(3), 28, "full")
    assert of_components.tolist() == [0, 2, 3]
    for k, covariance in zip((0, 2, 3), mixture.covariances, strict=True):
        expected = np.cov(points[kind == k].T, aweights=shares[kind == k], ddof=0)
        np.testing.assert_allclose(covariance, expected, atol=0.01)


def test_the_order_of_samples_does_not_matter(samples):
    points, shares, kind = samples
    order = np.random.default_rng(1).permutation(len(points))
    first, kinds = inside_parts.fitted_inside(training(points, shares), kind, np.eye(3), 28, "tied")
    again, kinds_again = inside_parts.fitted_inside(training(points, shares, order), kind[order], np.eye(3), 28, "tied")
    np.testing.assert_array_equal(kinds_again, kinds)
    np.testing.assert_allclose(again.means, first.means, atol=1e-9)
    np.testing.assert_allclose(again.covariances, first.covariances, atol=1e-9)


def test_equal_places_are_one_cluster():
    places = np.repeat([(0.0, 0), (1, 0), (5, 5)], [4, 3, 2], axis=0)
    cluster = inside_parts._clusters(places, np.ones(9), 7)
    assert set(cluster) == {0, 1, 2}
    assert len({*cluster[:4]}) == len({*cluster[4:7]}) == len({*cluster[7:]}) == 1
    assert inside_parts._clusters(places, np.ones(9), 1).tolist() == [0] * 9
    assert inside_parts._clusters(places[:1], np.ones(1), 5).tolist() == [0]


def test_later_axes_count_more_than_their_variance():
    """Along the principal axes samples are uncorrelated, with about the square root of their standard deviation."""
    generator = np.random.default_rng(0)
    variances = np.geomspace(10, 0.1, 30)
    points = generator.standard_normal((4000, 30)) * np.sqrt(variances)
    points -= points.mean(axis=0)
    turn = np.linalg.qr(generator.standard_normal((30, 30)))[0]
    projected = points @ turn @ part_mixture.principal_axes(training(points @ turn))
    covariance = projected.T @ projected / 4000
    expected = np.linalg.eigvalsh(points.T @ points / 4000)[:-21:-1]
    np.testing.assert_allclose(covariance, np.diag(expected / np.sqrt(expected + 0.01)), atol=1e-9)


def test_samples_have_the_kind_around_their_vertex():
    mesh = icosphere(2)
    workpiece = Workpiece(PoseSegmentation(**SMALL).describe(mesh))
    upper = (mesh.face_centers[:, 2] > 0).astype(int)
    height = places_on(workpiece.surface)[:, 2]
    vertex = np.flatnonzero(np.abs(height) > 0.35)[::-1]
    given = TrainingSamples(
        workpiece.signature[vertex], np.full(len(vertex), 1 / len(vertex)), np.zeros(len(vertex), dtype=int), vertex,
        Standardizer("raw", np.zeros(20), np.ones(20)), workpiece.signature[vertex],
    )  # fmt: skip
    found = part_mixture._kinds_of_samples([upper], [[workpiece]], given, 2)
    assert {0, 1} == set(found)
    np.testing.assert_array_equal(found, height[vertex] > 0)


FOUR = [np.arange(4)]
"""Kind of each of four faces."""


@pytest.mark.parametrize(
    ("lost", "merges", "expected", "likeness"),
    [
        # Merged into the same kind as before.
        (1, [(0, 2), (0, 3), (0, 1)], [(0, 1), (0, 2), (0, 3)], [1, 3, 2]),
        (3, [(2, 3), (0, 2), (0, 1)], [(2, 3), (0, 2), (0, 1)], [3, 2, 1]),
        # What was merged into the lost kind is merged into the one that takes it.
        (0, [(0, 2), (0, 3), (0, 1)], [(2, 0), (2, 3), (2, 1)], [3, 2, 1]),
        (2, [(0, 1), (2, 3), (0, 2)], [(3, 2), (0, 1), (0, 3)], [2, 3, 1]),
    ],
)
def test_a_kind_that_has_lost_its_area_is_merged_first(lost, merges, expected, likeness):
    """The others are merged in the order in which they were, each with its likeness."""
    kinds = Kinds(FOUR, np.array(merges), np.array([3.0, 2.0, 1.0]))
    left = np.where(np.arange(4) == lost, 0.0, 1.0)
    found = part_mixture._with_vanished_first(kinds, np.ones(4), left)
    assert [tuple(pair) for pair in found.merges.tolist()] == expected
    assert found.likeness.tolist() == likeness
    assert kinds.merges.tolist() == [list(pair) for pair in merges]


def test_all_kinds_are_merged_into_one_if_several_vanish():
    for merges in ([(0, 2), (0, 3), (0, 1)], [(2, 3), (0, 2), (0, 1)], [(0, 1), (2, 3), (0, 2)]):
        kinds = Kinds(FOUR, np.array(merges), np.array([3.0, 2.0, 1.0]))
        for only in range(4):
            found = part_mixture._with_vanished_first(kinds, np.ones(4), 4.0 * (np.arange(4) == only))
            left = {0, 1, 2, 3}
            for kept, gone in found.merges.tolist():
                assert kept in left
                left.remove(gone)
            assert len(left) == 1
            assert sorted(found.likeness) == [1, 2, 3]


def test_a_kind_that_keeps_enough_of_its_area_is_merged_as_before():
    kinds = Kinds(FOUR, np.array([(0, 2), (0, 3), (0, 1)]), np.array([3.0, 2.0, 1.0]))
    for n_kept in (8, 3, 1):
        found = part_mixture._with_vanished_first(
            kinds, np.array([4.0, 8, 1, 1]), np.array([12.0 - n_kept, n_kept, 1, 1])
        )
        assert found.merges[0].tolist() == ([0, 2] if n_kept / 8 >= VANISHED else [0, 1])
