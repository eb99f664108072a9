"""A body that was not learned is cut by its own shape, and its regions are recognized together."""

import numpy as np
import pytest
from shapes import creature, figure, icosphere, places_on, together

from wks_segment.core import PoseSegmentation, TriangleMesh
from wks_segment.core.labeling.own_parts import OwnParts, own_parts
from wks_segment.core.mesh.adjacency import FaceAdjacency, connected_regions
from wks_segment.core.parts.region_labels import MOST_UNLIKE, TEMPER
from wks_segment.core.poses.pose_cache import Workpiece
from wks_segment.core.progress import Progress

SMALL = {"n_segments": 4, "n_eigenpairs": 40, "n_energies": 20}


def balls():
    """A large ball between two small ones, which do not touch each other: islands that are tied."""
    ball = icosphere(1)
    sides = [TriangleMesh(0.6 * ball.vertices + (x, 0, 0), ball.faces) for x in (-2.5, 2.7)]
    return together(TriangleMesh(1.8 * ball.vertices, ball.faces), *sides)


@pytest.fixture(scope="module")
def workpiece():
    return Workpiece(PoseSegmentation(**SMALL).describe(balls()))


def on_balls(large, small):
    """Log-likelihoods of kinds: one row on the large ball and one on the small ones."""

    def log_likelihoods(pose):
        inside = np.abs(places_on(pose.surface)[:, :1]) < 1.81
        return np.where(inside, np.array([large], dtype=float), np.array([small], dtype=float))

    return log_likelihoods


def parts_of(workpiece, log_likelihoods, n_kinds=2):
    return own_parts([workpiece], log_likelihoods, n_kinds, Progress())


def of_balls(parts):
    """Parts that the three balls consist of; no part may be on two of them."""
    found = [set(of_ball.tolist()) for of_ball in np.split(parts.part, 3)]
    assert sum(len(one) for one in found) == len(set.union(*found)) == len(parts.of_parts)
    return [sorted(one) for one in found]


def check(parts, n_faces, n_kinds):
    """What holds for regions and parts of any mesh."""
    for of_faces, posteriors in (parts.region, parts.posteriors), (parts.part, parts.of_parts):
        count = len(posteriors)
        assert of_faces.shape == (n_faces,)
        assert set(of_faces) == set(range(count))
        assert posteriors.shape == (count, n_kinds)
        assert (posteriors >= 0).all()
        np.testing.assert_allclose(posteriors.sum(axis=1), 1)
    assert parts.touch.shape == (len(parts.of_parts),) * 2
    np.testing.assert_array_equal(parts.touch, parts.touch.T)
    assert not parts.touch.diagonal().any()


def test_each_ball_is_a_part_that_touches_its_neighbors(workpiece):
    parts = parts_of(workpiece, on_balls([0, -50], [-50, 0]))
    check(parts, balls().n_faces, 2)
    (large,), (left,), (right,) = of_balls(parts)
    assert parts.touch[large, left]
    assert parts.touch[large, right]
    assert not parts.touch[left, right]
    assert parts.of_parts.argmax(axis=1)[[large, left, right]].tolist() == [0, 1, 1]


def test_regions_that_are_one_part_have_one_kind(workpiece):
    """Faces on one side of each ball are like another kind, but those of the other side are so even more."""

    def log_likelihoods(pose):
        upper = places_on(pose.surface)[:, 2] > 0
        return np.where(upper[:, None], np.array([[0.0, -10]]), np.array([[-30.0, 0]]))

    parts = parts_of(workpiece, log_likelihoods)
    check(parts, balls().n_faces, 2)
    assert parts.posteriors.argmax(axis=1).tolist() == [1] * len(parts.posteriors)
    assert parts.posteriors[:, 1].min() > 0.9


def test_signatures_count_up_to_a_limit(workpiece):
    parts = parts_of(workpiece, on_balls([0, -1e6], [-1e6, 0]))
    # Nothing ties balls: a region of a ball that is one region has nothing but its signatures.
    sizes = [len(set(region.tolist())) for region in np.split(parts.region, 3)]
    alone = [i for i, size in enumerate(sizes) if size == 1]
    unlikely = 1 / (1 + np.exp(MOST_UNLIKE))
    assert parts.posteriors.min() > 0
    for i in alone:
        region = np.split(parts.region, 3)[i][0]
        np.testing.assert_allclose(parts.posteriors[region].min(), unlikely, rtol=0.1)


def test_log_likelihoods_are_means_over_the_poses():
    """Each of two poses tells the kinds of the balls half as clearly as both together."""
    mesh = balls()
    moved = TriangleMesh(mesh.vertices + (0, 0, 5), mesh.faces)
    poses = [Workpiece(pose) for pose in PoseSegmentation(**SMALL).describe_all([mesh, moved])]
    said = {id(poses[0]): 12.0, id(poses[1]): -8.0}

    def log_likelihoods(pose):
        return np.tile([0.0, said[id(pose)]], (len(pose.signature), 1))

    parts = own_parts(poses, log_likelihoods, 2, Progress())
    assert parts.posteriors.argmax(axis=1).tolist() == [1] * len(parts.posteriors)
    assert parts.posteriors[:, 1].min() >= 1 / (1 + np.exp(-2 / TEMPER)) - 1e-9


def parts_with(kinds, touch, n_kinds):
    """Parts of certain kinds, each of one face."""
    number, posteriors = np.arange(len(kinds)), np.eye(n_kinds)[np.array(kinds)]
    return OwnParts(number, posteriors, number, posteriors, np.array(touch, dtype=bool))


def test_parts_of_one_group_that_touch_are_one_whole():
    """Kinds 0 and 1 are one group, as upper and lower arm; the parts in the row are both arms and the body."""
    touch = np.zeros((5, 5), dtype=bool)
    for i in range(4):
        touch[i, i + 1] = touch[i + 1, i] = True
    parts = parts_with([0, 1, 2, 1, 0], touch, 3)
    whole, group = parts.wholes(np.array([0, 0, 1]))
    assert whole[0] == whole[1]
    assert whole[3] == whole[4]
    assert len(set(whole)) == 3
    assert group[whole].tolist() == [0, 0, 1, 0, 0]


def test_parts_of_one_kind_that_touch_are_two_wholes():
    touch = np.array([(0, 1, 1), (1, 0, 1), (1, 1, 0)])
    whole, group = parts_with([0, 0, 1], touch, 2).wholes(np.array([0, 1]))
    assert len(set(whole)) == 3
    assert group[whole].tolist() == [0, 0, 1]


def test_parts_that_do_not_touch_are_wholes_of_their_own():
    whole, group = parts_with([0, 1, 2], np.zeros((3, 3)), 3).wholes(np.array([0, 0, 0]))
    assert len(set(whole)) == 3
    assert group[whole].tolist() == [0, 0, 0]


def test_the_group_of_a_part_is_the_likeliest_one_of_all_its_kinds():
    """The likeliest kind is 0, but 1 and 2, of one group, are likelier together."""
    one, posteriors = np.array([0]), np.array([[0.4, 0.3, 0.3]])
    parts = OwnParts(one, posteriors, one, posteriors, np.zeros((1, 1), dtype=bool))
    whole, group = parts.wholes(np.array([0, 1, 1]))
    assert group[whole].tolist() == [1]


BODIES = [figure(0.0, 0.0, 2), creature(0.2, 2, seed=0)]


@pytest.fixture(scope="module")
def model():
    """Of two bodies."""
    return PoseSegmentation(**SMALL).fit(BODIES)


def borders(labels, mesh):
    """Pairs of neighboring faces with different labels."""
    pairs = FaceAdjacency.of(mesh.faces, mesh.vertices).pairs
    return {tuple(sorted(pair)) for pair in pairs[labels[pairs[:, 0]] != labels[pairs[:, 1]]].tolist()}


def test_each_body_is_cut_between_its_own_regions(model):
    """Posteriors of a face are those of its region, unless nothing is smoothed."""
    mesh = figure(0.5, -0.2, 2)
    workpiece = Workpiece(model.describe(mesh))
    labeler = model._labeler()
    own = labeler._own_parts([workpiece], Progress())
    check(own, mesh.n_faces, model.grouping_.n_kinds)
    on_faces = labeler._on_faces([workpiece], 4, Progress())(workpiece)
    for region in range(len(own.posteriors)):
        assert (np.ptp(on_faces[own.region == region], axis=0) == 0).all()
    np.testing.assert_allclose(on_faces.sum(axis=1), 1)
    # Smoothing moves borders, but most stay between the same regions.
    labels = model.segment_faces(workpiece)
    inside = [labels[own.region == region] for region in range(len(own.posteriors))]
    same = sum(np.bincount(of_region).max() for of_region in inside)
    assert same > 0.9 * mesh.n_faces


def test_without_smoothing_each_place_has_the_kind_of_its_signature(model):
    rough = PoseSegmentation.from_json(model.to_json())
    rough.smoothness = 0.0
    pose = rough.describe(BODIES[0])
    of_faces = pose.surface.to_faces(rough._labeler().posteriors(Workpiece(pose)))
    np.testing.assert_array_equal(rough.segment_faces(pose), of_faces.argmax(axis=1))


def test_labels_of_a_body_do_not_depend_on_the_order_of_its_faces(model):
    mesh = figure(0.2, 0.4, 2)
    order = np.random.default_rng(0).permutation(mesh.n_faces)
    labels = model.segment_faces(mesh)
    again = model.segment_faces(TriangleMesh(mesh.vertices, mesh.faces[order]))
    assert np.average(again == labels[order], weights=mesh.face_areas[order]) > 0.97


def test_regions_of_a_body_are_connected_and_numbered_as_learned(model):
    mesh = figure(0.1, 0.3, 2)
    regions = model.segment_regions(mesh)
    adjacency = FaceAdjacency.of(mesh.faces, mesh.vertices)
    assert connected_regions(regions, adjacency).max() + 1 == len(np.unique(regions))
    known = regions < len(model.regions_.side)
    assert mesh.face_areas[known].sum() > 0.5 * mesh.area


def test_every_number_of_segments_labels_a_body(model):
    """Also more than there are kinds."""
    pose = Workpiece(model.describe(figure(0.3, 0.0, 2)))
    for count in (1, 2, model.grouping_.n_kinds, model.grouping_.n_kinds + 5, len(model.mixture_.weights)):
        few = model.with_segments(count)
        labels = few.segment_faces(pose)
        assert labels.shape == (BODIES[0].n_faces,)
        assert labels.min() >= 0
        assert labels.max() < count
        soft = few.predict_soft(pose)
        assert soft.shape == (BODIES[0].n_vertices, count)
        np.testing.assert_allclose(soft.sum(axis=1), 1, atol=1e-6)
