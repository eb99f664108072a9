"""Log-likelihood of a shape, and leave-one-out log-likelihood of the training poses."""

from __future__ import annotations

from collections.abc import Callable
from functools import reduce

import numpy as np

from ..mesh.triangle_mesh import FloatArray, IntArray
from .gaussian_mixture import GaussianMixture, Moments, squares_of, variance_floor
from .part_mixture import PartMixture
from .standardizer import Standardizer
from .training_samples import TrainingSamples

LEFT_OUT = 0.1
"""Share of the area, the least likely, that does not count in `likely_mean`: places that a pose hides or glues
together, such as a hand on a thigh, are unlike all training poses and would outweigh everything else."""


def likely_mean(log_likelihoods: FloatArray, shares: FloatArray) -> float:
    """Mean of (n,) log-likelihoods over the likeliest part of the area, given (n,) shares of it that sum to 1."""
    order = np.argsort(log_likelihoods, kind="stable")
    counted = np.clip(np.cumsum(shares[order]) - LEFT_OUT, 0, shares[order])
    return float(counted @ log_likelihoods[order] / counted.sum())


def comparable_score(
    standardizer: Standardizer, log_likelihoods: FloatArray, signature: FloatArray, shares: FloatArray
) -> float:
    """Score of a shape that models with any parameters share; see `PoseSegmentation.comparable_score`.

    Parameters
    ----------
    standardizer : Standardizer
        Of the model.
    log_likelihoods : (n,) array
        Of the standardized signature under the mixture.
    signature : (n, d) array
    shares : (n,) array
        Shares of the area, which sum to 1.
    """
    densities = standardizer.comparable_densities(log_likelihoods, signature)
    return likely_mean(densities, shares) / standardizer.n_energies


def usual_scores(learned: PartMixture, training: TrainingSamples) -> FloatArray:
    """(poses,) comparable score that each training pose would have, had it not been learned.

    For a single pose it is the score that it has.
    """
    samples = training.standardized
    if training.n_poses > 1:
        likelihoods = left_out_likelihoods(
            learned.mixture, samples, training.shares, training.pose, learned.for_ranking
        )
    else:
        likelihoods = learned.for_ranking(learned.mixture).log_likelihoods(samples)
    scores = []
    for pose in np.unique(training.pose):
        chosen = training.pose == pose
        shares = training.shares[chosen] / training.shares[chosen].sum()
        scores.append(comparable_score(training.standardizer, likelihoods[chosen], training.signature[chosen], shares))
    return np.array(scores)


def left_out_likelihoods(
    mixture: GaussianMixture,
    samples: FloatArray,
    shares: FloatArray,
    group: IntArray,
    simplified: Callable[[GaussianMixture], GaussianMixture],
) -> FloatArray:
    """Log-likelihoods of samples under a mixture that was learned without their group.

    One step of EM from the given mixture, without the group, stands for learning again: each component keeps its
    meaning, but no longer knows the samples of the group.

    Parameters
    ----------
    mixture : GaussianMixture
        Fitted to all samples.
    samples : (n, d) array
    shares : (n,) array
        Weights of the samples: positive, sum to 1.
    group : (n,) int array
        Group of each sample, of at least two groups.
    simplified
        Gives the mixture whose likelihoods are asked for.

    Returns
    -------
    (n,) log-likelihoods.
    """
    floor = variance_floor(samples, shares)
    kind = mixture.covariance_type
    masses = mixture.posteriors(samples) * shares[:, None]
    groups = [group == i for i in np.unique(group)]
    moments = [Moments.of(samples[one], squares_of(samples[one], kind), masses[one], kind) for one in groups]
    likelihoods = np.empty(len(samples))
    for inside, own in zip(groups, moments, strict=True):
        others = reduce(Moments.plus, (one for one in moments if one is not own))
        likelihoods[inside] = simplified(others.mixture(kind, floor)).log_likelihoods(samples[inside])
    return likelihoods
