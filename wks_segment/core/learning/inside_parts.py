"""A mixture whose components are clusters of the signatures inside each part."""

from __future__ import annotations

import numpy as np

from ..mesh.triangle_mesh import BoolArray, FloatArray, IntArray
from .gaussian_mixture import CovarianceType, GaussianMixture, maximize, squares_of, variance_floor
from .k_means import k_means
from .training_samples import TrainingSamples

K_MEANS_ROUNDS = 10
"""Most rounds of k-means: later ones move places between clusters of one kind, and carry noise on."""


def fitted_inside(
    training: TrainingSamples, kind_of_samples: IntArray, axes: FloatArray, count: int, covariance_type: CovarianceType
) -> tuple[GaussianMixture, IntArray]:
    """Mixture of about `count` components, each the samples of a cluster inside one kind; and (K,) their kinds.

    Larger kinds have more clusters, by the square root of their area. With full matrices each kind has one.
    """
    places, shares = training.standardized @ axes, training.shares
    present = np.unique(kind_of_samples)
    sizes = np.sqrt([shares[kind_of_samples == k].sum() for k in present])
    cluster = np.empty(len(places), dtype=np.int64)
    kinds: list[int] = []
    for k, size in zip(present, sizes, strict=True):
        members = np.flatnonzero(kind_of_samples == k)
        wanted = 1 if covariance_type == "full" else max(1, round(count * size / sizes.sum()))
        inside = _clusters(places[members], shares[members], wanted)
        cluster[members] = len(kinds) + inside
        kinds += [int(k)] * (int(inside.max()) + 1)
    masses = np.zeros((len(places), len(kinds)))
    masses[np.arange(len(places)), cluster] = shares
    samples = training.standardized
    floor = variance_floor(samples, shares)
    return maximize(samples, squares_of(samples, covariance_type), masses, covariance_type, floor), np.array(kinds)


def _clusters(places: FloatArray, shares: FloatArray, count: int) -> IntArray:
    """(n,) cluster of each place by k-means: 0, 1, …; fewer than `count` if there are fewer distinct places."""
    if count == 1 or len(places) <= 1:
        return np.zeros(len(places), dtype=np.int64)
    halves = _halves(places, shares, count)
    starts = np.array(
        [np.average(places[halves == i], axis=0, weights=shares[halves == i]) for i in range(halves.max() + 1)]
    )
    found = k_means(places, shares, starts, K_MEANS_ROUNDS)
    return np.unique(found, return_inverse=True)[1].ravel()


def _halves(places: FloatArray, shares: FloatArray, count: int) -> IntArray:
    """(n,) cluster of each place: the widest one is halved, across its longest axis, until there are `count`.

    From these k-means ends alike after a little noise, which it does not from random places.
    """
    cluster = np.zeros(len(places), dtype=np.int64)
    width, far = _across_longest_axis(places, shares)
    widths, halves = [width], [far]
    while len(widths) < count:
        widest = int(np.argmax(widths))
        far = halves[widest]
        if not far.any():
            break
        members = np.flatnonzero(cluster == widest)
        cluster[members[far]] = len(widths)
        widths[widest], halves[widest] = _across_longest_axis(places[members[~far]], shares[members[~far]])
        width, far = _across_longest_axis(places[members[far]], shares[members[far]])
        widths.append(width)
        halves.append(far)
    return cluster


def _across_longest_axis(places: FloatArray, shares: FloatArray) -> tuple[float, BoolArray]:
    """Sum of squares of places along their longest axis, and (n,) which lie in its far half; none if all are equal."""
    offset = places - np.average(places, axis=0, weights=shares)
    squares, axes = np.linalg.eigh((offset * shares[:, None]).T @ offset)
    along = offset @ axes[:, -1]
    # A direction that does not depend on the library's choice of sign.
    far = along * (-1 if shares @ along**3 < 0 else 1) > 0
    return float(squares[-1]), far & bool(squares[-1] > 0 and not far.all())
