"""Sizes of the parts of each kind."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..mesh.triangle_mesh import FloatArray, IntArray

LEAST_SIZE_SPREAD = 0.25
"""Lower bound of the standard deviation of the logarithm of an area: learned bodies that are alike must not make every
other body look foreign."""


@dataclass(frozen=True)
class KindSizes:
    """Mean and standard deviation of the logarithm of a part's share of the area, for each kind.

    Attributes
    ----------
    mean, spread : (k,) arrays
    """

    mean: FloatArray
    spread: FloatArray

    @classmethod
    def of(cls, log_areas: FloatArray, kind: IntArray) -> KindSizes:
        """Sizes of the kinds of r parts, given (r,) logarithms of their shares of the area and their kinds."""
        of_kinds = [log_areas[kind == k] for k in range(int(kind.max()) + 1)]
        mean = np.array([logs.mean() for logs in of_kinds])
        spread = np.array([max(float(logs.std()), LEAST_SIZE_SPREAD) for logs in of_kinds])
        return cls(mean, spread)

    def of_kinds(self, kinds: IntArray) -> KindSizes:
        """Sizes of some of the kinds, in another order."""
        return KindSizes(self.mean[kinds], self.spread[kinds])
