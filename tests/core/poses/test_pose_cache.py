"""Relabeling with cached results gives the same labels; another number of segments needs no fit."""

import numpy as np
import pytest
from shapes import figure

from wks_segment.core import PoseSegmentation, Workpiece
from wks_segment.core.labeling import labeler
from wks_segment.core.poses.pose_signature import of_one_mesh

POSES = [figure(*lifted, subdivisions=3) for lifted in ((0.0, 0.0), (0.4, 0.1), (0.1, 0.5))]
POLYGONS = [np.arange(POSES[0].n_faces) // 2] * len(POSES)
SETTINGS = {"n_eigenpairs": 100, "n_energies": 60}


@pytest.fixture(scope="module")
def described():
    return PoseSegmentation(6, **SETTINGS).describe_all(POSES)


@pytest.fixture(scope="module")
def model(described):
    return PoseSegmentation(6, **SETTINGS).fit(described)


def outcome(model, poses):
    """All results of a model on poses."""
    labels = model.segment_polygons(poses, POLYGONS, 0.01)
    return [
        labels,
        model.polygon_sides(poses, POLYGONS, labels),
        *(model.polygon_sides([pose], POLYGONS[:1], labels) for pose in poses),
        *(model.predict_soft(pose) for pose in poses),
        model.segment_regions(poses[0]),
        model.segment_faces(poses[1]),
        model.predict(poses[2]),
    ]


def test_cached_labels_equal_new_labels_in_any_order_of_settings(model, described):
    workpieces = [Workpiece(pose) for pose in described]
    copies = {}
    for number, smoothness in ((6, 1.0), (3, 1.0), (3, 2.0), (9, 0.5), (6, 0.0), (6, 1.0), (3, 2.0)):
        if (number, smoothness) not in copies:
            other = model.with_segments(number)
            other.smoothness = smoothness
            copies[number, smoothness] = other, outcome(other, described)
        other, expected = copies[number, smoothness]
        for cached, new in zip(outcome(other, workpieces), expected, strict=True):
            np.testing.assert_array_equal(cached, new)


def test_marked_edges_and_min_share_are_not_cached(model, described):
    workpieces = [Workpiece(pose) for pose in described]
    ring = POSES[0].faces[:, 0] // 40
    for marked in (None, np.stack([ring[:-1], ring[1:]], axis=1)):
        for share in (0.0, 0.05, 0.0):
            cached, new = (model.segment_polygons(of, POLYGONS, share, marked=marked) for of in (workpieces, described))
            np.testing.assert_array_equal(cached, new)


def test_models_do_not_share_cached_results(model, described):
    workpieces = [Workpiece(pose) for pose in described]
    other = PoseSegmentation(6, **SETTINGS, covariance_type="spherical").fit(described)
    expected = [outcome(each, described) for each in (model, other)]
    for i in (0, 1, 0):
        for cached, new in zip(outcome((model, other)[i], workpieces), expected[i], strict=True):
            np.testing.assert_array_equal(cached, new)


def test_fit_to_workpieces_gives_the_same_model(model, described):
    again = PoseSegmentation(6, **SETTINGS).fit([Workpiece(pose) for pose in described])
    assert again.to_json() == model.to_json()


def test_labels_hardly_change_where_posteriors_are_too_many_to_keep(model, described, monkeypatch):
    usual = model.segment_polygons(described, POLYGONS)
    monkeypatch.setattr(labeler, "MOST_POSTERIORS", 0)
    assert (model.segment_polygons(described, POLYGONS) == usual).mean() > 0.999


def test_other_numbers_of_segments_are_nested(model, described):
    before = model.to_json()
    finest = model.with_segments(10).predict(described[0])
    for number in (2, 4, 6):
        coarse = model.with_segments(number).predict_proba(described[0])
        assert coarse.shape[1] == number
        # Groups of groups: faces of one fine segment are in one coarse segment.
        counts = np.zeros((10, number))
        np.add.at(counts, (finest, coarse.argmax(axis=1)), 1)
        assert counts.max(axis=1).sum() > 0.9 * counts.sum()
    assert model.to_json() == before


def test_learned_number_of_segments_gives_the_same_model(model, described):
    again = model.with_segments(4).with_segments(6, described)
    assert again.to_json() == model.to_json()
    np.testing.assert_array_equal(again.predict(described[0]), model.predict(described[0]))


def test_regions_follow_the_number_of_segments_if_poses_are_given(model, described):
    few = model.with_segments(2, described)
    assert few.regions_.n_groups == 2
    assert model.regions_.n_groups > 2
    assert model.with_segments(2).regions_ is model.regions_
    fitted = PoseSegmentation(2, **SETTINGS).fit(described)
    assert few.grouping_.number_of_wholes(2) == fitted.regions_.n_groups


def test_sides_follow_from_the_learned_regions(model, described):
    few, faces = model.with_segments(4), np.arange(POSES[0].n_faces)
    for pose in described:
        labels = few.segment_polygons([pose], [faces])
        side = few.polygon_sides([pose], [faces], labels)
        np.testing.assert_array_equal(side, model.polygon_sides([pose], [faces], labels))
        assert {-1, 1} <= set(side)


def test_open_number_of_segments_is_saved(model, described):
    auto = model.with_segments("auto")
    assert auto.n_segments_ == model.grouping_.natural
    read = PoseSegmentation.from_json(auto.to_json())
    np.testing.assert_array_equal(read.predict(described[1]), auto.predict(described[1]))


def test_several_poses_are_of_one_mesh_if_their_faces_are_the_same(described):
    assert of_one_mesh(described)
    assert not of_one_mesh(described[:1])
    other = PoseSegmentation(6, **SETTINGS).describe(figure(subdivisions=2))
    assert not of_one_mesh([*described, other])


def test_impossible_numbers_of_segments_are_refused(model, described):
    count = len(model.mixture_.weights)
    with pytest.raises(ValueError, match=f"n_segments is {count + 1}, but the model has {count} components: fit a new"):
        model.with_segments(count + 1)
    with pytest.raises(ValueError, match="n_segments must be a whole number"):
        model.with_segments(0)
    paper = PoseSegmentation(4, **SETTINGS, preset="paper").fit(described)
    with pytest.raises(ValueError, match="with the paper's setting each component is a segment"):
        paper.with_segments(3)
    with pytest.raises(ValueError, match="not fitted"):
        PoseSegmentation(4).with_segments(3)
