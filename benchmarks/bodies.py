"""Other people than MakeHuman's: its body with longer or shorter bones and more or less flesh on them."""

from __future__ import annotations

import numpy as np

from benchmarks.makehuman import MakeHuman
from wks_segment.core.mesh.triangle_mesh import FloatArray

MOST = 1.2
"""How many times as long or thick as MakeHuman's a part can be, or the other way round."""
SHARED = 0.5
"""How much of this is in common to a whole body: tall people have long arms and legs, stout ones are so everywhere."""
SCALED = (
    "root", "spine02", "neck01", "head", "pelvis", "upperleg", "lowerleg", "foot", "clavicle", "upperarm", "lowerarm",
    "wrist",
)  # fmt: skip
"""Parts with a scale of their own, by the beginnings of their bones' names; other bones have that of their parent."""
UPRIGHT = ("root", "spine02", "neck01", "head")
"""Parts whose length is their height; that of others is along the bone."""


def other_body(body: MakeHuman, seed: int) -> MakeHuman:
    """The body of somebody else, drawn by a seed: bones and the flesh on them scaled, both sides alike."""
    generator = np.random.default_rng(seed)
    whole = generator.uniform(-1, 1, 2)
    length_and_girth = {part: MOST ** (SHARED * whole + (1 - SHARED) * generator.uniform(-1, 1, 2)) for part in SCALED}
    scales = {}
    for name in body.bones:
        part = next((part for part in SCALED if name.startswith(part)), None)
        if part:
            length, girth = length_and_girth[part]
            axis = np.array((0.0, 1.0, 0.0)) if part in UPRIGHT else _direction(body, name)
            scales[name] = girth * np.eye(3) + (length - girth) * np.outer(axis, axis)
    return body.reshaped(scales)


def _direction(body: MakeHuman, name: str) -> FloatArray:
    """Where a bone points: from its head to those of the bones on it."""
    ends = [head for parent, head in body.bones.values() if parent == name]
    along = np.mean(ends, axis=0) - body.bones[name][1]
    return np.asarray(along / np.linalg.norm(along))
