"""Bodies of other proportions: that of MakeHuman with longer or shorter bones and more or less flesh on them."""

from __future__ import annotations

import numpy as np

from benchmarks.makehuman import MakeHuman
from wks_segment.core.mesh.triangle_mesh import FloatArray

MAX_SCALE = 1.2
"""Largest factor between the length or girth of a body part and that of MakeHuman's body, in either direction."""
SHARED_VARIATION = 0.5
"""Share of the variation that is common to the whole body: tall people have long arms and legs."""
SCALED = (
    "root", "spine02", "neck01", "head", "pelvis", "upperleg", "lowerleg", "foot", "clavicle", "upperarm", "lowerarm",
    "wrist",
)  # fmt: skip
"""Bones with a scale of their own, by the beginning of their names; other bones have the scale of their parent."""
UPRIGHT = ("root", "spine02", "neck01", "head")
"""Bones whose length is measured along the vertical axis, and not along the bone."""


def other_body(body: MakeHuman, seed: int, most: float = MAX_SCALE) -> MakeHuman:
    """A body with bones randomly scaled by a factor up to `most`, or by one over it, the same on both sides."""
    generator = np.random.default_rng(seed)
    whole = generator.uniform(-1, 1, 2)
    length_and_girth = {}
    for bone in SCALED:
        own = generator.uniform(-1, 1, 2)
        length_and_girth[bone] = most ** (SHARED_VARIATION * whole + (1 - SHARED_VARIATION) * own)
    scales = {}
    for name in body.bones:
        part = next((part for part in SCALED if name.startswith(part)), None)
        if part:
            length, girth = length_and_girth[part]
            axis = np.array((0.0, 1.0, 0.0)) if part in UPRIGHT else _direction(body, name)
            scales[name] = girth * np.eye(3) + (length - girth) * np.outer(axis, axis)
    return body.reshaped(scales)


def _direction(body: MakeHuman, name: str) -> FloatArray:
    """Unit vector from the head of a bone to the mean of the heads of its children."""
    ends = [head for parent, head in body.bones.values() if parent == name]
    along = np.mean(ends, axis=0) - body.bones[name][1]
    return np.asarray(along / np.linalg.norm(along))
