"""Regions take the label that costs least, against their ties to the regions that they touch."""

import itertools

import numpy as np

from wks_segment.core.parts.region_labels import MOST_UNLIKE, TEMPER, costs_among_others, region_labels, unlikeness


def row(*ties):
    """Ties between regions in a row."""
    table = np.zeros((len(ties) + 1,) * 2)
    for i, tie in enumerate(ties):
        table[i, i + 1] = table[i + 1, i] = tie
    return table


def total(costs, ties, labels):
    labels = np.asarray(labels)
    return costs[np.arange(len(costs)), labels].sum() + (ties * (labels[:, None] != labels)).sum() / 2


def test_without_ties_each_region_has_its_cheapest_label():
    costs = np.random.default_rng(0).random((9, 4))
    np.testing.assert_array_equal(region_labels(costs, np.zeros((9, 9))), costs.argmin(axis=1))


def test_a_region_with_little_to_say_follows_the_region_that_it_is_tied_to():
    costs = np.array([(0.0, 5.0), (1.0, 0.0), (5.0, 0.0)])
    assert region_labels(costs, row(2.0, 0.5)).tolist() == [0, 0, 1]
    assert region_labels(costs, row(0.5, 2.0)).tolist() == [0, 1, 1]


def test_regions_change_their_label_together():
    """Neither of the two would alone."""
    costs = np.array([(1.0, 0.0), (1.0, 0.0), (0.0, 9.0)])
    assert region_labels(costs, row(9.0, 3.0)).tolist() == [0, 0, 0]


def test_results_are_near_to_the_best_of_all():
    generator, excess = np.random.default_rng(1), []
    for _ in range(40):
        costs, ties = generator.random((6, 3)), np.triu(generator.random((6, 6)) * (generator.random((6, 6)) < 0.5), 1)
        ties = ties + ties.T
        best = min(total(costs, ties, labels) for labels in itertools.product(range(3), repeat=6))
        excess.append(total(costs, ties, region_labels(costs, ties)) - best)
    assert np.min(excess) > -1e-9
    assert np.mean(excess) < 0.01
    assert np.mean(np.array(excess) < 1e-9) > 0.9


def test_costs_among_others_are_those_of_a_single_change():
    generator = np.random.default_rng(2)
    costs, ties = generator.random((5, 3)), row(1.0, 2.0, 0.5, 1.5)
    labels = region_labels(costs, ties)
    among = costs_among_others(costs, ties, labels)
    for i in range(5):
        changed = [total(costs, ties, np.where(np.arange(5) == i, label, labels)) for label in range(3)]
        np.testing.assert_allclose(np.diff(among[i]), np.diff(changed))
    assert (among.argmin(axis=1) == labels).all()


def test_likely_kinds_cost_nothing_and_unlikely_ones_up_to_a_limit():
    np.testing.assert_allclose(unlikeness(np.array([[-3.0, -3.0 - TEMPER, -1e9]])), [[0.0, 1.0, MOST_UNLIKE]])
