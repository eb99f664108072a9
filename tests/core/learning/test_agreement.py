"""Meshes agree on the kinds of their regions: each region gets the kind that all other meshes say."""

import numpy as np

from wks_segment.core.learning.agreement import agreed_kinds
from wks_segment.core.learning.standardizer import Standardizer
from wks_segment.core.learning.training_samples import TrainingSamples

PLACES = np.array([(0.0, 0.0), (4.0, 0.0), (0.0, 4.0), (4.0, 4.0)])
"""Signatures of four parts, which all meshes have."""


def samples(n_meshes, each=40):
    """Samples of meshes whose regions are the four parts, and the region of each sample of each mesh."""
    generator = np.random.default_rng(0)
    region = np.repeat(np.arange(4), each)
    points = np.concatenate(
        [PLACES[region] + 0.3 * generator.standard_normal((len(region), 2)) for _ in range(n_meshes)]
    )
    count = len(points)
    standardizer = Standardizer("raw", np.zeros(2), np.ones(2))
    pose = np.repeat(np.arange(n_meshes), len(region))
    training = TrainingSamples(points, np.full(count, 1 / count), pose, np.arange(count), standardizer, points)
    return training, [region] * n_meshes


def agreed(kinds, least=1):
    training, region = samples(len(kinds))
    ties = [np.zeros((4, 4))] * len(kinds)
    return agreed_kinds([np.array(one) for one in kinds], ties, region, training, np.eye(2), least)


def test_what_all_say_stays():
    for of_mesh in agreed([(0, 1, 2, 3)] * 4):
        assert of_mesh.tolist() == [0, 1, 2, 3]


def test_one_mesh_that_says_otherwise_follows_the_others():
    for of_mesh in agreed([(0, 1, 2, 3), (0, 1, 2, 3), (0, 2, 1, 3), (0, 1, 2, 3)]):
        assert of_mesh.tolist() == [0, 1, 2, 3]


def test_a_kind_that_only_one_mesh_has_goes():
    found = agreed([(0, 1, 2, 3), (0, 1, 2, 3), (0, 1, 2, 4), (0, 1, 2, 3)])
    assert [of_mesh.tolist() for of_mesh in found] == [[0, 1, 2, 3]] * 4


def test_two_parts_of_one_kind_on_one_mesh_are_told_apart_as_on_the_others():
    found = agreed([(0, 1, 2, 3), (0, 0, 2, 3), (0, 1, 2, 3), (0, 1, 2, 3)])
    assert [of_mesh.tolist() for of_mesh in found] == [[0, 1, 2, 3]] * 4


def test_rounds_end_before_there_are_too_few_kinds():
    kinds = [(0, 1, 2, 3), (0, 1, 2, 3), (0, 1, 2, 4), (0, 1, 2, 3)]
    assert [of_mesh.tolist() for of_mesh in agreed(kinds, least=5)] == [list(of_mesh) for of_mesh in kinds]


def test_kinds_are_numbered_without_gaps():
    found = np.concatenate(agreed([(0, 1, 2, 7)] * 3))
    assert sorted(set(found.tolist())) == [0, 1, 2, 3]


def test_regions_without_samples_follow_their_ties():
    training, region = samples(3)
    table = np.zeros((5, 5))
    table[3, 4] = table[4, 3] = 1.0
    kinds = [np.array((0, 1, 2, 3, 0))] * 3
    for of_mesh in agreed_kinds(kinds, [table] * 3, region, training, np.eye(2), 1):
        assert of_mesh.tolist() == [0, 1, 2, 3, 3]
