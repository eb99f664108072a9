"""Colours: the same for a segment whatever the number of segments, and clearly different to the eye."""

import numpy as np
import pytest

from wks_segment.blender import palette as module
from wks_segment.blender.palette import MAX_COLOURS, colors_of, oklab, palette, sided_palette


def test_first_colours_do_not_depend_on_how_many_there_are(monkeypatch):
    few = module.palette.__wrapped__()
    monkeypatch.setattr(module, "MAX_COLOURS", 12)
    np.testing.assert_array_equal(module.palette.__wrapped__(), few[:12])


def test_colours_are_srgb_and_cannot_be_changed_by_accident():
    colours = palette()
    assert colours.shape == (MAX_COLOURS, 3)
    assert ((colours >= 0) & (colours <= 1)).all()
    with pytest.raises(ValueError, match="read-only"):
        colours[0] = 0


def closest_pair(count):
    lab = oklab(palette()[:count])
    distance = np.linalg.norm(lab[:, None] - lab[None], axis=2)
    return distance[np.triu_indices(count, 1)].min()


@pytest.mark.parametrize(("count", "least"), [(8, 0.14), (20, 0.08), (MAX_COLOURS, 0.04)])
def test_no_two_colours_are_close(count, least):
    assert closest_pair(count) > least


def test_no_colour_is_dark_or_grey_or_white():
    colours = palette()
    lab = oklab(colours)
    assert lab[:, 0].min() >= 0.49
    assert lab[:, 0].max() <= 0.9
    assert np.hypot(lab[:, 1], lab[:, 2]).min() >= 0.08
    assert colours.max(axis=1).min() > 0.4


def test_parts_in_the_middle_have_the_colours_of_the_palette():
    np.testing.assert_array_equal(sided_palette()[0], palette())
    np.testing.assert_array_equal(
        colors_of(np.array([5, 1005, 2005, 5 + MAX_COLOURS])), sided_palette()[[0, 1, 2, 0], 5]
    )


@pytest.mark.parametrize(("count", "least"), [(8, 0.1), (12, 0.07), (20, 0.05), (MAX_COLOURS, 0.025)])
def test_no_two_parts_have_close_colours(count, least):
    lab = oklab(sided_palette()[:, :count].reshape(-1, 3))
    distance = np.linalg.norm(lab[:, None] - lab[None], axis=2)
    assert distance[np.triu_indices(len(lab), 1)].min() > least


def test_left_is_light_and_right_is_dark_and_both_are_of_about_one_hue():
    middle, left, right = oklab(sided_palette())
    assert left[:, 0].min() > right[:, 0].max() + 0.05
    assert np.linalg.norm(left - right, axis=1).min() > 0.11
    hues = np.arctan2(*np.moveaxis(np.stack([middle, left, right])[..., [2, 1]], -1, 0))
    away = np.abs((hues[1:] - hues[0] + np.pi) % (2 * np.pi) - np.pi)
    assert away.max() < np.radians(36)


def test_no_part_is_black_or_grey_or_white():
    lab = oklab(sided_palette())
    assert 0.43 < lab[..., 0].min() < lab[..., 0].max() < 0.93
    assert np.hypot(lab[..., 1], lab[..., 2]).min() > 0.055
    assert sided_palette().max(axis=2).min() > 0.3


def test_oklab_of_known_colours():
    """The values that Ottosson gives for the primaries, to three digits."""
    primaries = np.array([[1.0, 1, 1], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, 0]])
    known = [[1, 0, 0], [0.628, 0.225, 0.126], [0.866, -0.234, 0.179], [0.452, -0.032, -0.312], [0, 0, 0]]
    np.testing.assert_allclose(oklab(primaries), known, atol=1e-3)
