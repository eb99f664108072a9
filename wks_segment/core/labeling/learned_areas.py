"""Posteriors whose segments have about the areas that were learned.

Where a body bends, its signature changes, and a border would move along a limb. But a part keeps its area in any pose,
and nearly so on other meshes and bodies. So the logarithms of the odds of each segment are shifted, the same on all
faces, until its area is the learned one: what is surely of one segment stays, and borders move back. With labels that
are known to have other shares than learned ones, weights are adjusted in the same way (Saerens et al., "Adjusting the
outputs of a classifier to new a priori probabilities", 2002).
"""

from __future__ import annotations

import numpy as np

from ..mesh.triangle_mesh import FloatArray

MOST_SHIFT = 1.0
"""Largest shift of the logarithm of the odds, so that a segment that is cut off is not sought elsewhere."""
MOST_ROUNDS, ENOUGH = 30, 1e-3
"""Rounds at most, and the change of shifts at which they end."""
LEAST = 1e-9
"""Least posterior and area, against a division by zero."""


def with_learned_areas(posteriors: FloatArray, areas: FloatArray, shares: FloatArray) -> FloatArray:
    """(p, K) posteriors of faces whose sums over the area are the learned shares, as far as `MOST_SHIFT` allows.

    Parameters
    ----------
    posteriors : (p, K) array
        Rows sum to 1.
    areas : (p,) array
        Of the faces.
    shares : (K,) array
        Share of the area of each segment as it was learned; their sum is 1.
    """
    weights, wanted = areas / areas.sum(), np.maximum(shares, LEAST)
    raised = np.maximum(posteriors, LEAST)
    shifts = np.zeros(len(wanted))
    for _ in range(MOST_ROUNDS):
        before = shifts
        found = raised.T @ (weights / (raised @ np.exp(shifts))) * np.exp(shifts)
        shifts = np.clip(shifts + np.log(wanted / np.maximum(found, LEAST)), -MOST_SHIFT, MOST_SHIFT)
        if np.abs(shifts - before).max() < ENOUGH:
            break
    result = raised * np.exp(shifts).astype(raised.dtype)
    return np.asarray(result / result.sum(axis=1, keepdims=True))
