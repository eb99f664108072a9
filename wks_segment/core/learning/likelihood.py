"""How well a mixture explains a shape, and how well it would explain what it was learned from, had it not been."""

from __future__ import annotations

import numpy as np

from ..mesh.triangle_mesh import FloatArray, IntArray
from .gaussian_mixture import GaussianMixture, maximize, variance_floor

LEFT_OUT = 0.1
"""Share of the area, the least likely, that does not count: what a pose hides or glues together, as a hand on a thigh,
is unlike anything that was learned, and would outweigh all else."""


def likely_mean(log_likelihoods: FloatArray, shares: FloatArray) -> float:
    """Mean of (n,) log-likelihoods over the likeliest part of the area, given (n,) shares of it that sum to 1."""
    order = np.argsort(log_likelihoods, kind="stable")
    counted = np.clip(np.cumsum(shares[order]) - LEFT_OUT, 0, shares[order])
    return float(counted @ log_likelihoods[order] / counted.sum())


def left_out_likelihoods(
    mixture: GaussianMixture, samples: FloatArray, shares: FloatArray, group: IntArray
) -> FloatArray:
    """How likely samples are to a mixture that was learned without their group.

    One step of EM from the mixture, without the group, stands for learning anew: components stay what they are of, but
    know the group's samples no more.

    Parameters
    ----------
    mixture : GaussianMixture
        Fitted to all samples.
    samples : (n, d) array
    shares : (n,) array
        Positive, sum to 1.
    group : (n,) int array
        The group of each sample, at least two.

    Returns
    -------
    (n,) log-likelihoods.
    """
    floor = variance_floor(samples, shares)
    squares = None if mixture.covariance_type in ("full", "tied") else samples**2
    masses = mixture.posteriors(samples) * shares[:, None]
    found = np.empty(len(samples))
    for i in np.unique(group):
        mine = group == i
        others = masses * ~mine[:, None]
        without = maximize(samples, squares, others / others.sum(), mixture.covariance_type, floor)
        found[mine] = without.log_likelihoods(samples[mine])
    return found
