import numpy as np
import pytest

from wks_segment.core.labeling.learned_areas import MOST_SHIFT, with_learned_areas


def posteriors_along(border, width=0.1, count=1000):
    """Posteriors of two segments along a limb, and the places of its faces: the border is at a place."""
    place = (np.arange(count) + 0.5) / count
    second = 1 / (1 + np.exp(-(place - border) / width))
    return np.stack([1 - second, second], axis=1), place


def test_a_border_that_has_moved_goes_back_to_where_the_areas_are_those_that_were_learned():
    posteriors, place = posteriors_along(0.45)
    found = with_learned_areas(posteriors, np.ones(1000), np.array([0.4, 0.6]))
    np.testing.assert_allclose(found.mean(axis=0), (0.4, 0.6), atol=1e-3)
    assert (found.argmax(axis=1) == (place > 0.4)).mean() > 0.98
    np.testing.assert_allclose(found.sum(axis=1), 1)


def test_areas_are_those_of_the_faces():
    posteriors, place = posteriors_along(0.5)
    areas = np.where(place < 0.5, 3.0, 1.0)
    found = with_learned_areas(posteriors, areas, np.array([0.7, 0.3]))
    np.testing.assert_allclose(areas @ found / areas.sum(), (0.7, 0.3), atol=2e-3)


def test_posteriors_with_the_learned_areas_stay():
    posteriors, _ = posteriors_along(0.45)
    found = with_learned_areas(posteriors, np.ones(1000), posteriors.mean(axis=0))
    np.testing.assert_allclose(found, posteriors, atol=1e-3)


def test_what_is_surely_of_one_segment_stays_where_another_one_is_missing():
    sure = np.tile([0.98, 0.02], (100, 1))
    found = with_learned_areas(sure, np.ones(100), np.array([0.5, 0.5]))
    assert (found.argmax(axis=1) == 0).all()
    odds = found[:, 1] / found[:, 0] / (0.02 / 0.98)
    assert odds == pytest.approx(np.exp(2 * MOST_SHIFT))


def test_a_segment_that_nothing_is_like_gets_nothing():
    posteriors, _ = posteriors_along(0.5)
    with_third = np.column_stack([posteriors, np.zeros(1000)])
    found = with_learned_areas(with_third, np.ones(1000), np.array([0.45, 0.45, 0.1]))
    assert found[:, 2].max() < 1e-6
