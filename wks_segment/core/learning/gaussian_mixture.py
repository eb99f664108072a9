"""A Gaussian mixture over weighted samples, fitted by expectation–maximization that cannot collapse.

scikit-learn's mixture takes no sample weights and has no covariance that all components share and that is diagonal,
which is the paper's remedy against over-fitting; hence our own. Its k-means starts it.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from scipy.linalg import solve_triangular
from scipy.special import logsumexp
from sklearn.cluster import KMeans
from sklearn.exceptions import ConvergenceWarning
from threadpoolctl import threadpool_limits

from ..mesh.triangle_mesh import FloatArray, IntArray

CovarianceType = Literal["shared", "diag", "full", "tied", "spherical"]

VARIANCE_FLOOR = 1e-3
"""Added to every variance, as a fraction of the samples' own mean variance."""
MAX_ITERATIONS = 200
TOLERANCE = 1e-3
"""EM ends when the mean log-likelihood rises by less than this in one round."""
SEEDS = range(6)
"""EM is started by k-means from each of these, on a sketch of the samples; the likeliest mixture is refined on all of
them. The same in every fit: what comes out is no matter of luck."""
SAME = 1e-3
"""Starts whose log-likelihoods differ by less than this share ended in the same mixture."""
SKETCHED = 0.3
"""Share of the work that the starts are."""
SKETCH = 4_000
"""Samples in the sketch."""
ROWS = 65_536
"""Samples in one block of the likelihood."""


class TooFewSamplesError(ValueError):
    """There are fewer different samples than components; `distinct` says how many."""

    def __init__(self, n_components: int, distinct: int) -> None:
        super().__init__(f"{n_components} components are too many: the samples have only {distinct} distinct values")
        self.distinct = distinct


@dataclass(frozen=True)
class GaussianMixture:
    """K Gaussians with weights.

    Attributes
    ----------
    covariance_type : str
        "shared" (one diagonal for all), "diag", "spherical" (one number a component), "tied" (one full matrix for
        all), "full".
    weights : (K,) array
        Sum to 1.
    means : (K, d) array
    covariances : array
        (d,) for "shared", (K, d) for "diag", (K,) for "spherical", (d, d) for "tied", (K, d, d) for "full".
    """

    covariance_type: CovarianceType
    weights: FloatArray
    means: FloatArray
    covariances: FloatArray

    def log_densities(self, samples: FloatArray) -> FloatArray:
        """(n, K) log of weight times density of each component at (n, d) samples."""
        blocks = [
            _log_gaussians(samples[start : start + ROWS], None, self.means, self.covariances, self.covariance_type)
            for start in range(0, max(len(samples), 1), ROWS)
        ]
        return np.concatenate(blocks) + np.log(self.weights)

    def posteriors(self, samples: FloatArray) -> FloatArray:
        """(n, K) probability of each component given each of the (n, d) samples; rows sum to 1."""
        logs = self.log_densities(samples)
        # Divided by their sum, not by e to its logarithm: of a large one the digits behind the point are lost.
        shares = np.exp(logs - logs.max(axis=1, keepdims=True))
        return np.asarray(shares / shares.sum(axis=1, keepdims=True))

    def log_likelihoods(self, samples: FloatArray) -> FloatArray:
        """(n,) log density of the whole mixture at (n, d) samples."""
        return np.asarray(logsumexp(self.log_densities(samples), axis=1))


def fit_mixture(
    samples: FloatArray,
    sample_weights: FloatArray,
    n_components: int,
    covariance_type: CovarianceType = "shared",
    random_state: int | None = None,
    progress: Callable[[float], None] | None = None,
) -> GaussianMixture:
    """The likeliest of the mixtures that `fit_mixtures` finds."""
    return fit_mixtures(samples, sample_weights, n_components, covariance_type, random_state, 1, progress)[0]


@threadpool_limits.wrap(limits=1)  # on samples this few, threads cost more than they gain
def fit_mixtures(
    samples: FloatArray,
    sample_weights: FloatArray,
    n_components: int,
    covariance_type: CovarianceType = "shared",
    random_state: int | None = None,
    keep: int = 1,
    progress: Callable[[float], None] | None = None,
) -> list[GaussianMixture]:
    """Fit mixtures to weighted samples by expectation–maximization, started by k-means.

    Parameters
    ----------
    samples : (n, d) array
    sample_weights : (n,) array
        Positive; only their ratios count.
    n_components : int
        K. Components come out in the order of the mean of their means, largest first, so that the order does not
        depend on the start.
    covariance_type
        See `GaussianMixture`.
    random_state : int, optional
        None: six starts, the same six in every fit, on a sketch that is spread evenly over the samples. A number: one
        start with this seed, as in the paper.
    keep : int
        Mixtures to return at most: the likeliest first, refined on all samples. Of starts that ended in the same
        mixture only one counts.
    progress : callable, optional
        Called with the share of the work that is done, 0 to 1, in every round. An error that it raises ends the work.

    Raises
    ------
    TooFewSamplesError
        If there are fewer different samples than components.
    ValueError
        If the covariance type is unknown.
    """
    if covariance_type not in get_args(CovarianceType):
        raise ValueError(f"covariance_type must be one of {get_args(CovarianceType)}, not {covariance_type!r}")
    shares = sample_weights / sample_weights.sum()
    seeds = SEEDS if random_state is None else [random_state]
    sketch, sketch_shares = samples, shares
    if len(samples) > SKETCH:
        sketch = samples[drawn_evenly(shares, SKETCH)]
        sketch_shares = np.full(SKETCH, 1 / SKETCH)
    floor = variance_floor(samples, shares)

    def tick(share: float) -> None:
        if progress:
            progress(share)

    candidates = []
    for i, seed in enumerate(seeds):
        tick(SKETCHED * i / len(seeds))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ConvergenceWarning)  # too few different samples: an error below
            kmeans = KMeans(n_components, n_init=1, random_state=seed)
            start = kmeans.fit_predict(sketch, sample_weight=sketch_shares)
        if len(np.unique(start)) < n_components:
            raise TooFewSamplesError(n_components, len(np.unique(start)))
        candidates.append(
            _maximize_likelihood(
                sketch, sketch_shares, np.eye(n_components)[start], covariance_type, floor,
                lambda share, begun=i: tick(SKETCHED * (begun + share) / len(seeds)),  # type: ignore[misc]
            )
        )  # fmt: skip
    candidates.sort(key=lambda candidate: -candidate[1])
    different = [
        candidate
        for i, candidate in enumerate(candidates)
        if i == 0 or candidates[i - 1][1] - candidate[1] > SAME * abs(candidate[1])
    ][:keep]
    refined = []
    for i, (candidate, _) in enumerate(different):
        mixture, _ = _maximize_likelihood(
            samples, shares, candidate.posteriors(samples), covariance_type, floor,
            lambda share, begun=i: tick(SKETCHED + (1 - SKETCHED) * (begun + share) / len(different)),  # type: ignore[misc]
        )  # fmt: skip
        refined.append(_in_order(mixture))
    tick(1.0)
    return refined


def variance_floor(samples: FloatArray, shares: FloatArray) -> float:
    """What is added to every variance."""
    return VARIANCE_FLOOR * float(shares @ ((samples - shares @ samples) ** 2).mean(axis=1))


def drawn_evenly(shares: FloatArray, count: int) -> IntArray:
    """(count,) samples that stand for all of them: at equal steps along their (n,) shares, which sum to 1.

    A heavy sample comes several times. Neighbors in memory are neighbors on a surface, so that no place is left out.
    """
    steps = (np.arange(count) + 0.5) / count
    return np.asarray(np.minimum(np.searchsorted(np.cumsum(shares), steps), len(shares) - 1))


def _maximize_likelihood(
    samples: FloatArray,
    shares: FloatArray,
    start: FloatArray,
    covariance_type: CovarianceType,
    floor: float,
    tick: Callable[[float], None],
) -> tuple[GaussianMixture, float]:
    """EM from (n, K) responsibilities; the mixture and its mean log-likelihood."""
    previous = -np.inf
    squares = None
    if covariance_type not in ("full", "tied"):
        # What both steps need of the samples if covariances are diagonal, once. They come standardized, so that sums of
        # squares lose no digits, also not in single precision, which takes half the time.
        samples = samples.astype(np.float32)
        squares = samples**2
    responsibilities = start.astype(samples.dtype)
    shares = shares.astype(samples.dtype)
    for i in range(MAX_ITERATIONS):
        tick(i / MAX_ITERATIONS)
        mixture = maximize(samples, squares, responsibilities * shares[:, None], covariance_type, floor)
        logs = _log_gaussians(samples, squares, mixture.means, mixture.covariances, covariance_type)
        logs += np.log(mixture.weights).astype(logs.dtype)
        highest = logs.max(axis=1, keepdims=True)
        responsibilities = np.exp(logs - highest)
        total = responsibilities.sum(axis=1, keepdims=True)
        responsibilities /= total
        current = float(shares.astype(np.float64) @ (highest + np.log(total))[:, 0].astype(np.float64))
        if current - previous < TOLERANCE:
            break
        previous = current
    return mixture, current


def maximize(
    samples: FloatArray,
    squares: FloatArray | None,
    masses: FloatArray,
    covariance_type: CovarianceType,
    floor: float,
) -> GaussianMixture:
    """M-step for (n, K) masses that sum to 1, with `floor` added to each variance."""
    # An empty component keeps a vanishing weight instead of dividing by zero.
    weights = masses.sum(axis=0, dtype=np.float64) + 10 * np.finfo(float).tiny ** 0.5
    means = (masses.T @ samples).astype(np.float64) / weights[:, None]
    covariances: FloatArray
    if squares is None:
        scatter = np.stack([_scatter(samples - mean, mass) for mean, mass in zip(means, masses.T, strict=True)])
        covariances = scatter.sum(axis=0) if covariance_type == "tied" else scatter / weights[:, None, None]
        covariances = covariances + floor * np.eye(samples.shape[1])
    elif covariance_type == "shared":
        # Summed over components first: one row of squares instead of one a component.
        covariances = np.maximum((masses.sum(axis=1) @ squares).astype(np.float64) - weights @ means**2, 0) + floor
    else:
        covariances = np.maximum((masses.T @ squares).astype(np.float64) / weights[:, None] - means**2, 0) + floor
        if covariance_type == "spherical":
            covariances = covariances.mean(axis=1)
    return GaussianMixture(covariance_type, weights / weights.sum(), means, covariances)


def _scatter(centered: FloatArray, mass: FloatArray) -> FloatArray:
    return (centered * mass[:, None]).T @ centered


def _log_gaussians(
    samples: FloatArray,
    squares: FloatArray | None,
    means: FloatArray,
    covariances: FloatArray,
    covariance_type: CovarianceType,
) -> FloatArray:
    """(n, K) log densities, without the weights; `squares` of samples that are centered, if they are at hand."""
    n_components, dimension = means.shape
    if covariance_type in ("full", "tied"):
        matrices = np.broadcast_to(covariances, (n_components, dimension, dimension))
        factors = np.linalg.cholesky(matrices)
        half_log_determinants = np.log(np.diagonal(factors, axis1=1, axis2=2)).sum(axis=1)
        distances = np.stack(
            [
                (solve_triangular(factor, (samples - mean).T, lower=True) ** 2).sum(axis=0)
                for factor, mean in zip(factors, means, strict=True)
            ],
            axis=1,
        )
    else:
        # (1, d) if components share it: what only depends on the sample is then computed once for all.
        variances = covariances[:, None] if covariance_type == "spherical" else np.atleast_2d(covariances)
        half_log_determinants = np.log(np.broadcast_to(variances, (len(variances), dimension))).sum(axis=1) / 2
        # Σ (x − μ)² / v, multiplied out so that it is two matrix products. Centered first, against cancellation.
        center = means.mean(axis=0)
        x, mu = (samples - center, means - center) if squares is None else (samples, means)
        squared = x**2 if squares is None else squares
        inverse = np.broadcast_to(1 / variances, (len(variances), dimension))
        dtype = x.dtype
        distances = squared @ inverse.T.astype(dtype) - 2 * (x @ (mu / variances).T.astype(dtype))
        distances += (mu**2 / variances).sum(axis=1).astype(dtype)
        half_log_determinants = half_log_determinants.astype(dtype)
    return np.asarray(-distances / 2 - half_log_determinants - dimension * np.log(2 * np.pi) / 2)


def _in_order(mixture: GaussianMixture) -> GaussianMixture:
    order = np.argsort(-mixture.means.mean(axis=1), kind="stable")
    per_component = mixture.covariance_type in ("diag", "spherical", "full")
    covariances = mixture.covariances[order] if per_component else mixture.covariances
    return GaussianMixture(mixture.covariance_type, mixture.weights[order], mixture.means[order], covariances)
