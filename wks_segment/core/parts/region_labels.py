"""Labels of the regions of a mesh: what each region is by itself, against its ties to the regions that it touches."""

from __future__ import annotations

import numpy as np

from ..mesh.triangle_mesh import FloatArray, IntArray, connected_groups

TEMPER, MOST_UNLIKE = 5.0, 12.0
"""Log-likelihoods of a signature are divided by the first, since its energies tell much the same, and are at most the
second below the best."""
MOST_SWEEPS = 30
"""Most rounds over all regions. Two to five are usual."""


def unlikeness(log_likelihoods: FloatArray) -> FloatArray:
    """(r, k) costs of kinds for regions, given the mean log-likelihood of each kind inside each region."""
    return np.minimum((log_likelihoods.max(axis=1, keepdims=True) - log_likelihoods) / TEMPER, MOST_UNLIKE)


def region_labels(costs: FloatArray, ties: FloatArray) -> IntArray:
    """(r,) label of each region, so that costs and the ties between regions with different labels have a small sum.

    Single regions, then connected regions of one label together, take the label that costs least, again and again
    (Besag, "On the statistical analysis of dirty pictures", 1986), from the cheapest label of each region and from the
    cheapest one for all; the better result counts.

    Parameters
    ----------
    costs : (r, k) array
        Of each label for each region.
    ties : (r, r) array
        Symmetric: what it costs that two regions have different labels; 0 for those that do not touch.
    """
    everywhere = np.full(len(costs), int(costs.sum(axis=0).argmin()))
    found = [_improved(costs, ties, start) for start in (costs.argmin(axis=1), everywhere)]
    totals = [costs[np.arange(len(costs)), one].sum() + (ties * (one[:, None] != one)).sum() / 2 for one in found]
    return found[int(np.argmin(totals))]


def costs_among_others(costs: FloatArray, ties: FloatArray, labels: IntArray) -> FloatArray:
    """(r, k) cost of each label for each region if all other regions keep theirs."""
    return np.asarray(costs + ties.sum(axis=1, keepdims=True) - ties @ np.eye(costs.shape[1])[labels])


def _improved(costs: FloatArray, ties: FloatArray, labels: IntArray) -> IntArray:
    labels = labels.copy()
    tied = ties > 0
    for _ in range(MOST_SWEEPS):
        before = labels.copy()
        for i in range(len(costs)):
            labels[i] = (costs[i] - np.bincount(labels, ties[i], costs.shape[1])).argmin()
        block = connected_groups(np.argwhere(np.triu(tied & (labels[:, None] == labels), 1)), len(labels))
        for number in range(int(block.max()) + 1):
            inside = block == number
            bonds = np.bincount(labels[~inside], ties[np.ix_(inside, ~inside)].sum(axis=0), costs.shape[1])
            labels[inside] = (costs[inside].sum(axis=0) - bonds).argmin()
        if (labels == before).all():
            break
    return labels
