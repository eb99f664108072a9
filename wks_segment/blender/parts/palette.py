"""Palettes for parts: clearly different colors, never black, the same for a part whatever the number of segments."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from math import radians

import numpy as np

from ...core.mesh.triangle_mesh import BoolArray, FloatArray, IntArray
from .part_ids import segments_of, sides_of

MAX_COLORS = 64
"""Colors of a palette; segments beyond that repeat them."""
STEPS = 24
"""Values of red, green and blue that candidates for colors are combined from."""
LIGHTNESS = (0.50, 0.86)
"""Range of lightness in OKLab, 0 black to 1 white: shading must stay readable on every color."""
CHROMA = (0.085, 0.18)
"""Range of the distance from gray in OKLab: gray is what an object without segments looks like, neon tires the eye."""
FIRST_COLOR = (0.86, 0.34, 0.28)
"""The first color, from which the others are chosen: a warm red."""
BRIGHT_COLORS = (
    (1, 0, 0), (0, 0.26, 1), (0, 1, 0), (0, 0.48, 0),
    (1, 0.52, 1), (0.04, 0.70, 0.87), (1, 0.74, 0.39), (0.65, 0, 0.65),
)  # fmt: skip
"""First eight colors of *Maximally Different*: pure red, and seven with a lightness above 0.5 and a chroma above 0.13.
Of the sets that exchanging single colors of 60 random sets led to, this one is the farthest apart, 0.27 in OKLab, and
its order keeps the first few as far apart as they can be. Colors chosen one after the other would be as far apart, but
the fourth is nearly black."""
LEFT_LIGHTNESS, RIGHT_LIGHTNESS = (0.70, 0.92), (0.44, 0.60)
"""Ranges of lightness for parts on the left and on the right: sides differ by lightness."""
SIDED_CHROMA = (0.06, 0.30)
"""Range of the distance from gray for parts on the left and on the right, wider so that they can differ."""
SIDED_HUE = radians(35)
"""Largest angle between the hues of a segment's left or right part and its color in the middle, so that both sides are
recognized as the same segment."""
USUAL, RARE = 12, 1.7
"""Few characters have more segments than `USUAL`: colors of parts with sides may be nearer to the palette's colors
beyond that, by the factor `RARE`."""

# Björn Ottosson, "A perceptual color space for image processing" (2020): linear sRGB to cone responses to OKLab.
_TO_CONES = np.array(
    [
        [0.4122214708, 0.5363325363, 0.0514459929],
        [0.2119034982, 0.6806995451, 0.1073969566],
        [0.0883024619, 0.2817188376, 0.6299787005],
    ]
)
_TO_LAB = np.array(
    [
        [0.2104542553, 0.7936177850, -0.0040720468],
        [1.9779984951, -2.4285922050, 0.4505937099],
        [0.0259040371, 0.7827717662, -0.8086757660],
    ]
)
# Machado, Oliveira and Fernandes, "A physiologically-based model for simulation of color vision deficiency" (2009):
# linear sRGB as it is seen without the cones for red, green and blue.
BLINDNESS = np.array(
    [
        [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
        [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
        [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]],
    ]
)
_COLOR_VISIONS = np.concatenate([np.eye(3)[None], BLINDNESS])


@dataclass(frozen=True)
class Recipe:
    """Colors that a palette may have, and whether color-blind people must be able to tell them apart.

    Files keep the name and the number of a palette, so neither these nor its colors ever change: other colors make
    another palette.
    """

    number: int
    title: str
    description: str
    lightness: tuple[float, float]
    chroma: tuple[float, float]
    left: tuple[float, float] = LEFT_LIGHTNESS
    right: tuple[float, float] = RIGHT_LIGHTNESS
    sided_hue: float = SIDED_HUE
    color_blind: bool = False
    first: tuple[tuple[float, float, float], ...] = (FIRST_COLOR,)

    def seen(self, srgb: FloatArray) -> FloatArray:
        """(k, …, 3) sRGB colors in OKLab, as each of k kinds of color vision sees them."""
        return np.stack(
            [_lab_of_linear(linear(srgb) @ eye.T) for eye in _COLOR_VISIONS[: 4 if self.color_blind else 1]]
        )


DEFAULT_PALETTE = "calm"
RECIPES = {
    DEFAULT_PALETTE: Recipe(
        0, "Calm", "Clearly different and easy on the eye: shading stays readable on all of them", LIGHTNESS, CHROMA
    ),
    "distinct": Recipe(
        3, "Maximally Different", "As different as a screen can show, with neon colors, the first ones all bright",
        (0.30, 0.97), (0.06, 0.40),
        first=BRIGHT_COLORS,
    ),
    "color_blind": Recipe(
        2, "Color-Blind Safe", "Can be told apart by people without cones for red, green or blue, partly by lightness",
        # Darker colors would differ more, but look black in solid shading.
        (0.45, 0.97), (0.04, 0.40), (0.72, 0.97), (0.45, 0.64), radians(90), color_blind=True,
    ),
    "maximal": Recipe(
        1, "Different (Old)",
        "The colors that Maximally Different had before; files that have them keep them",
        (0.30, 0.97), (0.06, 0.40),
    ),
}  # fmt: skip


@cache
def palette(name: str = DEFAULT_PALETTE) -> FloatArray:
    """(MAX_COLORS, 3) sRGB colors, 0 to 1: each looks as different as possible from all before it."""
    recipe = RECIPES[name]
    candidates, lab = _candidates()
    candidates = candidates[_within(lab, recipe.lightness, recipe.chroma)]
    seen = recipe.seen(candidates)
    chosen = [np.array(color, dtype=float) for color in recipe.first[:MAX_COLORS]]
    nearest = np.min([_distance(seen, recipe.seen(color)) for color in chosen], axis=0)
    while len(chosen) < MAX_COLORS:
        farthest = int(np.argmax(nearest))
        chosen.append(candidates[farthest])
        nearest = np.minimum(nearest, _distance(seen, seen[:, farthest]))
    colors = np.stack(chosen)
    colors.setflags(write=False)
    return colors


@cache
def sided_palette(name: str = DEFAULT_PALETTE) -> FloatArray:
    """(3, MAX_COLORS, 3) sRGB colors of parts in the middle (the palette), on the left and on the right.

    Each color looks as different as possible from the whole palette and from all colors of sides before it.
    """
    recipe, colors = RECIPES[name], palette(name)
    candidates, lab = _candidates()
    seen, middle = recipe.seen(candidates), recipe.seen(colors)
    hue = _hue(lab)
    factor = np.where(np.arange(MAX_COLORS) < USUAL, 1, RARE)
    nearest = np.min([_distance(seen, middle[:, i]) * f for i, f in enumerate(factor)], axis=0)
    sided = np.tile(colors, (3, 1, 1))
    allowed = [_within(lab, lightness, SIDED_CHROMA) for lightness in (recipe.left, recipe.right)]
    for segment, own in enumerate(_hue(oklab(colors))):
        alike = np.cos(hue - own) >= np.cos(recipe.sided_hue)
        for side, within in enumerate(allowed, start=1):
            farthest = int(np.argmax(np.where(alike & within, nearest, -1)))
            sided[side, segment] = candidates[farthest]
            nearest = np.minimum(nearest, _distance(seen, seen[:, farthest]))
    sided.setflags(write=False)
    return sided


def _distance(seen: FloatArray, color: FloatArray) -> FloatArray:
    """(n,) smallest distance, over k kinds of color vision, of (k, n, 3) colors to a (k, 3) color."""
    return np.asarray(np.linalg.norm(seen - color[:, None], axis=2).min(axis=0))


def _candidates() -> tuple[FloatArray, FloatArray]:
    """(STEPS³, 3) sRGB colors to choose from, and the same colors in OKLab."""
    axis = np.linspace(0, 1, STEPS)
    colors = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)
    return colors, oklab(colors)


def _within(lab: FloatArray, lightness: tuple[float, float], chroma: tuple[float, float]) -> BoolArray:
    """(n,) whether (n, 3) colors in OKLab are within these ranges of lightness and of the distance from gray."""
    gray = np.hypot(lab[:, 1], lab[:, 2])
    light = lab[:, 0]
    return (light >= lightness[0]) & (light <= lightness[1]) & (gray >= chroma[0]) & (gray <= chroma[1])


def _hue(lab: FloatArray) -> FloatArray:
    """(n,) angle of the hue of (n, 3) colors in OKLab."""
    return np.arctan2(lab[:, 2], lab[:, 1])


def colors_of(parts: IntArray, name: str = DEFAULT_PALETTE) -> FloatArray:
    """(…, 3) sRGB color of each part in a palette; colors repeat after MAX_COLORS segments."""
    return sided_palette(name)[sides_of(parts), segments_of(parts) % MAX_COLORS]


def most_different(candidates: FloatArray, used: FloatArray) -> int:
    """Index of the one of (n, 3) sRGB colors that looks most different from the (k, 3) used colors."""
    apart = np.linalg.norm(oklab(candidates)[:, None] - oklab(used), axis=2)
    return int(apart.min(axis=1, initial=np.inf).argmax())


def linear(srgb: FloatArray) -> FloatArray:
    """(…, 3) linear RGB of sRGB colors, as materials need it."""
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)


def as_srgb(light: FloatArray) -> FloatArray:
    """(…, 3) sRGB colors of linear RGB, the inverse of `linear`."""
    return np.where(light <= 0.0031308, 12.92 * light, 1.055 * np.maximum(light, 0.0031308) ** (1 / 2.4) - 0.055)


def oklab(srgb: FloatArray) -> FloatArray:
    """(…, 3) sRGB colors in OKLab, where distances are as large as the differences that people see."""
    return _lab_of_linear(linear(srgb))


def _lab_of_linear(light: FloatArray) -> FloatArray:
    return np.asarray(np.cbrt(np.clip(light, 0, 1) @ _TO_CONES.T) @ _TO_LAB.T)
