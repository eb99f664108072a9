"""k-means from given centers."""

import numpy as np
import pytest
from sklearn.cluster import KMeans

from wks_segment.core.learning.k_means import k_means


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("rounds", [1, 10, 300])
def test_clusters_are_those_of_scikit_learn(seed, rounds):
    turn = np.random.default_rng(seed)
    places = turn.normal(size=(400, 6)) * [3, 2, 1, 1, 0.1, 0.1] + 50
    shares = turn.uniform(0.1, 1, len(places))
    centers = places[:: len(places) // 12]
    expected = KMeans(len(centers), init=centers, n_init=1, max_iter=rounds).fit_predict(places, sample_weight=shares)
    np.testing.assert_array_equal(k_means(places, shares, centers, rounds), expected)


def test_a_center_without_places_stays():
    places = np.array([[0.0], [1.0], [10.0]])
    assert k_means(places, np.ones(3), np.array([[0.5], [100.0], [9.0]]), 5).tolist() == [0, 0, 2]
    assert k_means(places, np.array([1.0, 0.0, 0.0]), np.array([[0.0], [5.0]]), 5).tolist() == [0, 0, 1]
