"""What the parts of each kind have in common besides their signatures: their sizes, and which kinds touch."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..mesh.triangle_mesh import BoolArray, FloatArray, IntArray

LEAST_SIZE_SPREAD = 0.25
"""Lower bound of the standard deviation of the logarithm of an area: learned bodies that are alike must not make every
other body look foreign."""
PRIOR_PAIRS = 2.0
"""Number of pairs of parts of two kinds that the mean over all kinds counts for: few pairs must not rule anything
out."""


@dataclass(frozen=True)
class KindTraits:
    """Traits of the parts of k kinds.

    Attributes
    ----------
    mean, spread : (k,) arrays
        Mean and standard deviation of the logarithm of a part's share of the area.
    touching : (k, k) array
        Probability that two parts of these kinds on one mesh touch.
    """

    mean: FloatArray
    spread: FloatArray
    touching: FloatArray

    @classmethod
    def of(cls, kinds: Sequence[IntArray], log_areas: Sequence[FloatArray], touch: Sequence[BoolArray]) -> KindTraits:
        """Traits of the kinds of the parts of some meshes.

        For each mesh: (r,) kinds of its parts, (r,) logarithms of their shares of the area, and the (r, r) table of
        which of them touch.
        """
        kind, logs = np.concatenate(kinds), np.concatenate(log_areas)
        count = int(kind.max()) + 1
        of_kinds = [logs[kind == k] for k in range(count)]
        mean = np.array([one.mean() for one in of_kinds])
        spread = np.array([max(float(one.std()), LEAST_SIZE_SPREAD) for one in of_kinds])
        pairs, touching = np.zeros((count, count)), np.zeros((count, count))
        for of_mesh, table in zip(kinds, touch, strict=True):
            first, second = np.nonzero(~np.eye(len(of_mesh), dtype=bool))
            np.add.at(pairs, (of_mesh[first], of_mesh[second]), 1.0)
            np.add.at(touching, (of_mesh[first], of_mesh[second]), table[first, second])
        usual = (touching.sum() + 1) / (pairs.sum() + 2)
        return cls(mean, spread, (touching + PRIOR_PAIRS * usual) / (pairs + PRIOR_PAIRS))

    def of_kinds(self, kinds: IntArray) -> KindTraits:
        """Traits of some of the kinds, in another order."""
        return KindTraits(self.mean[kinds], self.spread[kinds], self.touching[np.ix_(kinds, kinds)])
