"""Colours for parts: clearly different, never black, and the same for a part whatever the number of segments."""

from __future__ import annotations

from functools import cache
from math import radians

import numpy as np

from ..core.mesh import BoolArray, FloatArray, IntArray
from .parts import segments_of, sides_of

MAX_COLOURS = 64
STEPS = 24
"""Candidates along each of red, green and blue."""
LIGHTNESS = (0.50, 0.86)
"""Range of lightness in OKLab, 0 black to 1 white: shading must stay readable on every colour."""
CHROMA = (0.085, 0.18)
"""Range of the distance from grey in OKLab: grey is what an object without segments looks like, neon tires the eye."""
FIRST = (0.86, 0.34, 0.28)
"""The colour to start from, a warm red."""
LEFT, RIGHT = (0.70, 0.92), (0.44, 0.60)
"""The same range of lightness for parts on the left and on the right, which are told apart by it …"""
SIDED_CHROMA = (0.06, 0.30)
SIDED_HUE = radians(35)
"""… and recognised by a hue that differs from that of their segment by this angle at most."""
USUAL, RARE = 12, 1.7
"""Colours of the palette behind so many are needed by few characters: they may be nearer by this factor."""

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


@cache
def palette() -> FloatArray:
    """(MAX_COLOURS, 3) sRGB colours, 0 to 1: each as far as possible, to the eye, from all before it."""
    candidates, lab = _candidates()
    kept = _within(lab, LIGHTNESS, CHROMA)
    candidates, lab = candidates[kept], lab[kept]
    chosen = [np.array(FIRST)]
    nearest = np.linalg.norm(lab - oklab(chosen[0]), axis=1)
    while len(chosen) < MAX_COLOURS:
        farthest = int(np.argmax(nearest))
        chosen.append(candidates[farthest])
        nearest = np.minimum(nearest, np.linalg.norm(lab - lab[farthest], axis=1))
    colours = np.stack(chosen)
    colours.setflags(write=False)
    return colours


@cache
def sided_palette() -> FloatArray:
    """(3, MAX_COLOURS, 3) sRGB colours of the parts in the middle, which are those of the palette, left and right.

    Each as far as possible, to the eye, from all of the palette and from all sides before it.
    """
    candidates, lab = _candidates()
    hue = _hue(lab)
    middle = oklab(palette())
    factor = np.where(np.arange(MAX_COLOURS) < USUAL, 1, RARE)
    nearest = np.min(
        [np.linalg.norm(lab - colour, axis=1) * f for colour, f in zip(middle, factor, strict=True)], axis=0
    )
    colours = np.tile(palette(), (3, 1, 1))
    allowed = [_within(lab, lightness, SIDED_CHROMA) for lightness in (LEFT, RIGHT)]
    for segment, own in enumerate(_hue(middle)):
        alike = np.cos(hue - own) >= np.cos(SIDED_HUE)
        for side, within in enumerate(allowed, start=1):
            farthest = int(np.argmax(np.where(alike & within, nearest, -1)))
            colours[side, segment] = candidates[farthest]
            nearest = np.minimum(nearest, np.linalg.norm(lab - lab[farthest], axis=1))
    colours.setflags(write=False)
    return colours


def _candidates() -> tuple[FloatArray, FloatArray]:
    """(STEPS³, 3) sRGB colours to choose from, and the same in OKLab."""
    axis = np.linspace(0, 1, STEPS)
    colours = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)
    return colours, oklab(colours)


def _within(lab: FloatArray, lightness: tuple[float, float], chroma: tuple[float, float]) -> BoolArray:
    """(n,) whether (n, 3) colours in OKLab are within these ranges of lightness and of the distance from grey."""
    grey = np.hypot(lab[:, 1], lab[:, 2])
    light = lab[:, 0]
    return (light >= lightness[0]) & (light <= lightness[1]) & (grey >= chroma[0]) & (grey <= chroma[1])


def _hue(lab: FloatArray) -> FloatArray:
    """(n,) angle of the hue of (n, 3) colours in OKLab."""
    return np.arctan2(lab[:, 2], lab[:, 1])


def colors_of(parts: IntArray) -> FloatArray:
    """(…, 3) sRGB color of each part; they repeat after MAX_COLOURS segments."""
    return sided_palette()[sides_of(parts), segments_of(parts) % MAX_COLOURS]


def most_different(used: FloatArray) -> FloatArray:
    """(3,) the sRGB color of the palette that is, to the eye, as far as can be from the (k, 3) used ones."""
    apart = np.linalg.norm(oklab(palette())[:, None] - oklab(used), axis=2)
    return np.asarray(palette()[int(apart.min(axis=1).argmax())])


def linear(srgb: FloatArray) -> FloatArray:
    """(…, 3) sRGB colours in linear light, as materials take them."""
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)


def oklab(srgb: FloatArray) -> FloatArray:
    """(…, 3) sRGB colours in OKLab, where a distance is what the eye sees."""
    return np.cbrt(linear(srgb) @ _TO_CONES.T) @ _TO_LAB.T
