"""Colours for segments: clearly different, never black, and the same for a segment whatever the number of segments."""

from __future__ import annotations

from functools import cache

import numpy as np

from ..core.mesh import FloatArray, IntArray

MAX_COLOURS = 64
STEPS = 24
"""Candidates along each of red, green and blue."""
LIGHTNESS = (0.50, 0.86)
"""Range of lightness in OKLab, 0 black to 1 white: shading must stay readable on every colour."""
CHROMA = (0.085, 0.18)
"""Range of the distance from grey in OKLab: grey is what an object without segments looks like, neon tires the eye."""
FIRST = (0.86, 0.34, 0.28)
"""The colour to start from, a warm red."""

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
    axis = np.linspace(0, 1, STEPS)
    candidates = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)
    lab = oklab(candidates)
    light = (lab[:, 0] >= LIGHTNESS[0]) & (lab[:, 0] <= LIGHTNESS[1])
    chroma = np.hypot(lab[:, 1], lab[:, 2])
    kept = light & (chroma >= CHROMA[0]) & (chroma <= CHROMA[1])
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


def colors_of(components: IntArray) -> FloatArray:
    """(…, 3) sRGB color of each component; they repeat after MAX_COLOURS."""
    return palette()[components % MAX_COLOURS]


def linear(srgb: FloatArray) -> FloatArray:
    """(…, 3) sRGB colours in linear light, as materials take them."""
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)


def oklab(srgb: FloatArray) -> FloatArray:
    """(…, 3) sRGB colours in OKLab, where a distance is what the eye sees."""
    return np.cbrt(linear(srgb) @ _TO_CONES.T) @ _TO_LAB.T
