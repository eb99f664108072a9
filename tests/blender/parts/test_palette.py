"""Colors: the same for a segment whatever the number of segments, and clearly different for people."""

import hashlib

import numpy as np
import pytest

from wks_segment.blender.parts import palette as module
from wks_segment.blender.parts.palette import MAX_COLORS, colors_of, oklab, palette, sided_palette


def test_first_colors_do_not_depend_on_the_number_of_colors(monkeypatch):
    few = module.palette.__wrapped__()
    monkeypatch.setattr(module, "MAX_COLORS", 12)
    np.testing.assert_array_equal(module.palette.__wrapped__(), few[:12])


def test_colors_are_srgb_and_cannot_be_changed_by_accident():
    colors = palette()
    assert colors.shape == (MAX_COLORS, 3)
    assert ((colors >= 0) & (colors <= 1)).all()
    with pytest.raises(ValueError, match="read-only"):
        colors[0] = 0


def closest_pair(count):
    lab = oklab(palette()[:count])
    distance = np.linalg.norm(lab[:, None] - lab[None], axis=2)
    return distance[np.triu_indices(count, 1)].min()


@pytest.mark.parametrize(("count", "least"), [(8, 0.14), (20, 0.08), (MAX_COLORS, 0.04)])
def test_no_two_colors_are_close(count, least):
    assert closest_pair(count) > least


def test_no_color_is_dark_or_gray_or_white():
    colors = palette()
    lab = oklab(colors)
    assert lab[:, 0].min() >= 0.49
    assert lab[:, 0].max() <= 0.9
    assert np.hypot(lab[:, 1], lab[:, 2]).min() >= 0.08
    assert colors.max(axis=1).min() > 0.4


def test_parts_in_the_middle_have_the_colors_of_the_palette():
    np.testing.assert_array_equal(sided_palette()[0], palette())
    np.testing.assert_array_equal(
        colors_of(np.array([5, 1005, 2005, 5 + MAX_COLORS])), sided_palette()[[0, 1, 2, 0], 5]
    )


@pytest.mark.parametrize(("count", "least"), [(8, 0.1), (12, 0.07), (20, 0.05), (MAX_COLORS, 0.025)])
def test_no_two_parts_have_close_colors(count, least):
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


def test_no_part_is_black_or_gray_or_white():
    lab = oklab(sided_palette())
    assert 0.43 < lab[..., 0].min() < lab[..., 0].max() < 0.93
    assert np.hypot(lab[..., 1], lab[..., 2]).min() > 0.055
    assert sided_palette().max(axis=2).min() > 0.3


def test_oklab_of_known_colors():
    """The values that Ottosson gives for the primaries, to three digits."""
    primaries = np.array([[1.0, 1, 1], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, 0]])
    known = [[1, 0, 0], [0.628, 0.225, 0.126], [0.866, -0.234, 0.179], [0.452, -0.032, -0.312], [0, 0, 0]]
    np.testing.assert_allclose(oklab(primaries), known, atol=1e-3)


# Palettes to choose from

BLINDNESS = {
    "without red": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "without green": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
    "without blue": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]],
}
"""Machado, Oliveira and Fernandes (2009), severity 1: linear RGB as people without one kind of cones see it."""


def as_seen(srgb, eyes):
    """sRGB colors as somebody sees them."""
    return module.as_srgb(np.clip(module.linear(srgb) @ np.array(eyes).T, 0, 1))


def closest(srgb):
    lab = oklab(srgb.reshape(-1, 3))
    distance = np.linalg.norm(lab[:, None] - lab[None], axis=2)
    return distance[np.triu_indices(len(lab), 1)].min()


@pytest.mark.parametrize(("count", "least"), [(4, 0.22), (8, 0.12), (12, 0.1), (16, 0.08), (MAX_COLORS, 0.035)])
@pytest.mark.parametrize("eyes", [np.eye(3), *BLINDNESS.values()], ids=["all cones", *BLINDNESS])
def test_color_blind_safe_colors_are_told_apart_without_a_kind_of_cones(eyes, count, least):
    assert closest(as_seen(palette("color_blind")[:count], eyes)) > least


@pytest.mark.parametrize("eyes", [np.eye(3), *BLINDNESS.values()], ids=["all cones", *BLINDNESS])
def test_color_blind_safe_colors_of_sides_are_told_apart(eyes):
    colors = as_seen(sided_palette("color_blind")[:, :8], eyes)
    assert closest(colors) > 0.035
    assert np.linalg.norm(oklab(colors[1]) - oklab(colors[2]), axis=1).min() > 0.13


def test_color_blind_safe_colors_are_bright_enough_for_shading():
    """As bright as the darkest of the calm ones, about: faces turned away from the light keep their color."""
    assert oklab(sided_palette("color_blind"))[..., 0].min() > 0.44


def test_the_calm_palette_is_not_color_blind_safe():
    """Otherwise the color-blind safe palette would not be needed."""
    assert min(closest(as_seen(palette()[:8], eyes)) for eyes in BLINDNESS.values()) < 0.06


@pytest.mark.parametrize("name", ["distinct", "maximal"])
@pytest.mark.parametrize(("count", "least"), [(4, 0.38), (8, 0.27), (16, 0.17), (MAX_COLORS, 0.09)])
def test_maximally_different_colors_are_farther_apart_than_the_calm_ones(count, least, name):
    assert closest(palette(name)[:count]) > max(least, 1.2 * closest(palette()[:count]))


def test_the_first_maximally_different_colors_are_bright():
    lab = oklab(palette("distinct")[:8])
    assert palette("distinct")[0].tolist() == [1, 0, 0]
    assert lab[:, 0].min() > 0.49
    assert np.hypot(lab[:, 1], lab[:, 2]).min() > 0.12


@pytest.mark.parametrize(
    ("name", "number", "digest"),
    [("calm", 0, "78b7704846f7236a"), ("maximal", 1, "470cd29ccc48455a"), ("color_blind", 2, "1b130c2cc98c6c01")],
)
def test_palettes_that_files_have_keep_their_number_and_colors(name, number, digest):
    colors = np.round(sided_palette(name), 6)
    assert (module.RECIPES[name].number, hashlib.sha256(colors.tobytes()).hexdigest()[:16]) == (number, digest)


def test_srgb_is_the_inverse_of_linear():
    colors = np.linspace(0, 1, 256)
    np.testing.assert_allclose(module.as_srgb(module.linear(colors)), colors, atol=1e-6)


@pytest.mark.parametrize("name", module.RECIPES)
def test_every_palette_is_srgb_and_has_nothing_black_and_a_left_lighter_than_the_right(name):
    colors = sided_palette(name)
    assert colors.shape == (3, MAX_COLORS, 3)
    assert ((colors >= 0) & (colors <= 1)).all()
    middle, left, right = oklab(colors)
    assert middle[:, 0].min() > 0.24
    assert left[:, 0].min() > right[:, 0].max() + 0.04
    in_bytes = np.rint(255 * colors).reshape(-1, 3)
    assert len(np.unique(in_bytes, axis=0)) == 3 * MAX_COLORS


FIELD_LETTERS = 20
"""Letters of a name that the field in the sidebar shows, about: it cuts off the rest."""


@pytest.mark.parametrize("name", module.RECIPES)
def test_names_of_palettes_fit_into_the_field(name):
    assert len(module.RECIPES[name].title) <= FIELD_LETTERS
