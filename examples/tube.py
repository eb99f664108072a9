"""A tube that bends in its middle: the shape of the examples in docstrings and of docs/python.md."""

from __future__ import annotations

import numpy as np

from wks_segment.core import TriangleMesh


def tube(bend: float, length: float = 4.0, rings: int = 24, around: int = 12) -> TriangleMesh:
    """A closed tube whose second half is turned by `bend` radians; thin in the middle, with a thicker end."""
    along = np.linspace(0, 1, rings)
    radius = 0.25 + 0.25 * np.abs(along - 0.5) + 0.15 * along
    angle = 2 * np.pi * np.arange(around) / around
    turn = bend * np.clip(4 * (along - 0.375), 0, 1)  # within the middle quarter
    forward = np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1)
    upward = np.stack([-np.sin(turn), np.cos(turn), 0 * turn], axis=1)
    middle = np.concatenate([[[0, 0, 0]], np.cumsum(forward[:-1] * length / (rings - 1), axis=0)])
    ring = np.cos(angle)[:, None] * upward[:, None] + np.sin(angle)[:, None] * np.array([0, 0, 1.0])
    vertices = np.concatenate([(middle[:, None] + radius[:, None, None] * ring).reshape(-1, 3), middle[[0, -1]]])
    faces = []
    for i in range(around):
        j, first, last = (i + 1) % around, rings * around, rings * around + 1
        for k in range(0, (rings - 1) * around, around):
            faces += [(k + i, k + around + i, k + j), (k + j, k + around + i, k + around + j)]
        end = (rings - 1) * around
        faces += [(first, i, j), (last, end + j, end + i)]
    return TriangleMesh(vertices, np.array(faces))
