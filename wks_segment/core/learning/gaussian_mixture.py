"""Gaussian mixture of weighted samples, fitted by expectation–maximization (EM) that cannot collapse.

Why not scikit-learn's `GaussianMixture`: it takes no sample weights, so a densely meshed hand would count more than a
coarse back; and it lacks the covariance that is diagonal and shared by all components ("shared"), the paper's remedy
against over-fitting. With diagonal covariances, EM here also runs in single precision, in half the time. K-means, which
starts EM, is scikit-learn's.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from scipy.linalg import solve_triangular
from scipy.special import logsumexp

from ..mesh.triangle_mesh import FloatArray, IntArray
from ..message import Message
from ..progress import Progress, ShareFunction
from ..threads import one_thread

CovarianceType = Literal["shared", "diag", "full", "tied", "spherical"]

VARIANCE_FLOOR = 1e-3
"""Added to every variance, as a fraction of the mean variance of the samples: keeps a component from shrinking to one
point, where its likelihood would be infinite."""
SHRINKAGE = 0.02
"""How far the full matrix that all components share ("tied") is moved toward its diagonal: poses that were not learned
vary in directions in which the learned ones happen not to."""
MAX_ITERATIONS = 200
"""Maximum number of EM rounds, in case `EM_TOLERANCE` does not end them."""
EM_TOLERANCE = 1e-3
"""EM ends when the mean log-likelihood rises by less than this in one round."""
SEEDS = range(6)
"""Seeds of the k-means starts. They are the same in every fit, so that the result is not a matter of luck; the best
one is refined on all samples."""
STARTS_SHARE = 0.3
"""Share of the time that the starts take; the rest is refining."""
SKETCH_SIZE = 4_000
"""Number of samples that the starts see: enough to choose among them, at a fifth of the time of all samples."""
BLOCK_ROWS = 65_536
"""Number of samples whose likelihood is computed at once, which bounds the memory."""


class TooFewSamplesError(ValueError):
    """There are fewer distinct samples than components; `distinct` is their number."""

    def __init__(self, n_components: int, distinct: int) -> None:
        super().__init__(
            Message(
                "{count} components are too many: the samples have only {distinct} distinct values",
                count=n_components,
                distinct=distinct,
            )
        )
        self.distinct = distinct


@dataclass(frozen=True)
class GaussianMixture:
    """Mixture of K Gaussians with weights.

    Attributes
    ----------
    covariance_type : str
        "shared" (one diagonal for all), "diag", "spherical" (one number a component), "tied" (one full matrix for
        all), "full".
    weights : (K,) array
        Weights of the components; they sum to 1.
    means : (K, d) array
    covariances : array
        (d,) for "shared", (K, d) for "diag", (K,) for "spherical", (d, d) for "tied", (K, d, d) for "full".

    Examples
    --------
    >>> import numpy as np
    >>> from wks_segment.core import fit_mixture
    >>> samples = np.concatenate([np.zeros((50, 1)), np.ones((50, 1))]) + np.linspace(0, 0.1, 100)[:, None]
    >>> mixture = fit_mixture(samples, np.ones(100), n_components=2, random_state=0)
    >>> mixture.weights.round(2).tolist()
    [0.5, 0.5]
    """

    covariance_type: CovarianceType
    weights: FloatArray
    means: FloatArray
    covariances: FloatArray

    def log_densities(self, samples: FloatArray) -> FloatArray:
        """(n, K) logarithm of weight times density of each component at (n, d) samples."""
        blocks = [
            _log_gaussians(
                samples[start : start + BLOCK_ROWS], None, self.means, self.covariances, self.covariance_type
            )
            for start in range(0, max(len(samples), 1), BLOCK_ROWS)
        ]
        return np.concatenate(blocks) + np.log(self.weights)

    def posteriors(self, samples: FloatArray) -> FloatArray:
        """(n, K) probability of each component given each of the (n, d) samples; rows sum to 1."""
        logs = self.log_densities(samples)
        # Division by the sum keeps more digits than subtracting its logarithm would, which can be large.
        shares = np.exp(logs - logs.max(axis=1, keepdims=True))
        return np.asarray(shares / shares.sum(axis=1, keepdims=True))

    def group_posteriors(self, samples: FloatArray, group: IntArray, n_groups: int) -> FloatArray:
        """(n, n_groups) sums of the posteriors over the components of each group, given (K,) the group of each.

        In single precision, block by block: posteriors of all components together would take several times the memory.
        """
        member = np.eye(n_groups, dtype=np.float32)[group]
        blocks = [samples[start : start + BLOCK_ROWS] for start in range(0, max(len(samples), 1), BLOCK_ROWS)]
        return np.concatenate([self.posteriors(block).astype(np.float32) @ member for block in blocks])

    def group_log_likelihoods(self, samples: FloatArray, group: IntArray, n_groups: int) -> FloatArray:
        """(n, n_groups) log-density of each group of components as a mixture of its own."""
        logs, member = self.log_densities(samples), np.eye(n_groups)[group]
        highest = logs.max(axis=1, keepdims=True)
        sums = np.maximum(np.exp(logs - highest) @ member, np.finfo(float).tiny)
        return np.asarray(np.log(sums) + highest - np.log(self.weights @ member))

    def without_correlations(self) -> GaussianMixture:
        """The mixture with the diagonal of the one full covariance; itself if it is of another type."""
        if self.covariance_type != "tied":
            return self
        return GaussianMixture("shared", self.weights, self.means, np.diag(self.covariances).copy())

    def log_likelihoods(self, samples: FloatArray) -> FloatArray:
        """(n,) log-density of the whole mixture at (n, d) samples."""
        return np.asarray(logsumexp(self.log_densities(samples), axis=1))


@one_thread  # the same digits on every machine, and on samples this few more threads cost more than they gain
def fit_mixture(
    samples: FloatArray,
    sample_weights: FloatArray,
    n_components: int,
    covariance_type: CovarianceType = "shared",
    random_state: int | None = None,
    progress: ShareFunction | Progress | None = None,
) -> GaussianMixture:
    """Fit a mixture to weighted samples by expectation–maximization from several starts by k-means.

        mixture = fit_mixture(samples, np.ones(len(samples)), 3, "diag")
        labels = mixture.posteriors(samples).argmax(axis=1)

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
    random_state : int or None
        None: six starts, the same six in every fit, on a sketch that is spread evenly over the samples; the likeliest
        one is refined on all samples. A number: one start with this seed, as in the paper.
    progress
        Called in every round of EM with the share of the work that is done.

    Raises
    ------
    TooFewSamplesError
        If there are fewer distinct samples than components.
    ValueError
        If the covariance type is unknown.

    Examples
    --------
    >>> import numpy as np
    >>> from wks_segment.core import fit_mixture
    >>> samples = np.concatenate([np.zeros((50, 1)), np.ones((50, 1))]) + np.linspace(0, 0.1, 100)[:, None]
    >>> mixture = fit_mixture(samples, np.ones(100), n_components=2, random_state=0)
    >>> sorted(mixture.means.ravel().round(2).tolist())
    [0.02, 1.08]
    """
    if covariance_type not in get_args(CovarianceType):
        raise ValueError(
            Message(
                "covariance_type must be one of {choices}, not {value!r}",
                choices=", ".join(get_args(CovarianceType)),
                value=covariance_type,
            )
        )
    step = Progress.of_share(progress)
    shares = sample_weights / sample_weights.sum()
    sketch, sketch_shares = samples, shares
    if len(samples) > SKETCH_SIZE:
        sketch = samples[drawn_evenly(shares, SKETCH_SIZE)]
        sketch_shares = np.full(SKETCH_SIZE, 1 / SKETCH_SIZE)
    floor = variance_floor(samples, shares)
    starts = []
    for seed, part in step.part(0.0, STARTS_SHARE).each(list(SEEDS) if random_state is None else [random_state]):
        responsibilities = _k_means(sketch, sketch_shares, n_components, seed)
        starts.append(_maximize_likelihood(sketch, sketch_shares, responsibilities, covariance_type, floor, part))
    start = max(starts, key=lambda found: found[1])[0]
    refining = step.part(STARTS_SHARE, 1.0)
    mixture, _ = _maximize_likelihood(samples, shares, start.posteriors(samples), covariance_type, floor, refining)
    refining(1.0)
    return _in_order(mixture)


def _k_means(samples: FloatArray, shares: FloatArray, n_clusters: int, seed: int) -> FloatArray:
    """(n, K) responsibilities, 0 or 1, by k-means; TooFewSamplesError if there are too few distinct samples."""
    # Only the paper's setting and `fit_mixture` need it, and it takes long to import.
    from sklearn.cluster import KMeans
    from sklearn.exceptions import ConvergenceWarning

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)  # about too few distinct samples: the error below says it
        cluster = KMeans(n_clusters, n_init=1, random_state=seed).fit_predict(samples, sample_weight=shares)
    distinct = len(np.unique(cluster))
    if distinct < n_clusters:
        raise TooFewSamplesError(n_clusters, distinct)
    return np.asarray(np.eye(n_clusters)[cluster])


def variance_floor(samples: FloatArray, shares: FloatArray) -> float:
    """The number that is added to every variance, for (n, d) samples with (n,) shares that sum to 1."""
    return VARIANCE_FLOOR * float(shares @ ((samples - shares @ samples) ** 2).mean(axis=1))


def drawn_evenly(shares: FloatArray, count: int) -> IntArray:
    """(count,) indices of samples that represent all: at equal steps along their (n,) shares, which sum to 1.

    A sample with a large share is drawn several times. Samples that are neighbors in memory are neighbors on a surface,
    so that no place is left out.
    """
    steps = (np.arange(count) + 0.5) / count
    return np.asarray(np.minimum(np.searchsorted(np.cumsum(shares), steps), len(shares) - 1))


def _maximize_likelihood(
    samples: FloatArray,
    shares: FloatArray,
    start: FloatArray,
    covariance_type: CovarianceType,
    floor: float,
    progress: Progress,
) -> tuple[GaussianMixture, float]:
    """Mixture by EM from (n, K) responsibilities, and its mean log-likelihood."""
    previous = -np.inf
    if covariance_type not in ("full", "tied"):
        # Samples are standardized, so that sums of squares keep their digits in single precision, which takes half the
        # time.
        samples = samples.astype(np.float32)
    squares = squares_of(samples, covariance_type)
    responsibilities = start.astype(samples.dtype)
    shares = shares.astype(samples.dtype)
    for i in range(MAX_ITERATIONS):
        progress(i / MAX_ITERATIONS)
        mixture = maximize(samples, squares, responsibilities * shares[:, None], covariance_type, floor)
        logs = _log_gaussians(samples, squares, mixture.means, mixture.covariances, covariance_type)
        logs += np.log(mixture.weights).astype(logs.dtype)
        highest = logs.max(axis=1, keepdims=True)
        responsibilities = np.exp(logs - highest)
        total = responsibilities.sum(axis=1, keepdims=True)
        responsibilities /= total
        current = float(shares.astype(np.float64) @ (highest + np.log(total))[:, 0].astype(np.float64))
        if current - previous < EM_TOLERANCE:
            break
        previous = current
    return mixture, current


def squares_of(samples: FloatArray, covariance_type: CovarianceType) -> FloatArray | None:
    """(n, d) squares of samples, to be computed once: with diagonal covariances both steps of EM need no more."""
    return None if covariance_type in ("full", "tied") else samples**2


def maximize(
    samples: FloatArray,
    squares: FloatArray | None,
    masses: FloatArray,
    covariance_type: CovarianceType,
    floor: float,
) -> GaussianMixture:
    """M-step of EM: mixture of (n, d) samples with (n, K) responsibilities times shares, which sum to 1.

    `squares` are the (n, d) squares of the samples, None with full matrices; `floor` is added to each variance.
    """
    return Moments.of(samples, squares, masses, covariance_type).mixture(covariance_type, floor)


@dataclass(frozen=True)
class Moments:
    """Sums over samples that an M-step needs; those of two sets of samples add up.

    Attributes
    ----------
    weights : (K,) array
        Sum of the masses of each component.
    first : (K, d) array
        Sum of masses times samples.
    second : array
        Sum of masses times products of the samples: of the shape of the covariances, except (K, d) for "spherical".
    """

    weights: FloatArray
    first: FloatArray
    second: FloatArray

    @classmethod
    def of(
        cls, samples: FloatArray, squares: FloatArray | None, masses: FloatArray, covariance_type: CovarianceType
    ) -> Moments:
        """Sums over (n, d) samples with (n, K) masses; see `maximize`."""
        second: FloatArray
        if covariance_type == "tied":
            second = (samples * masses.sum(axis=1)[:, None]).T @ samples
        elif squares is None:
            second = np.stack([(samples * mass[:, None]).T @ samples for mass in masses.T])
        else:
            # The sum over components comes first: it needs one row of squares instead of one for each component.
            second = (masses.sum(axis=1) if covariance_type == "shared" else masses.T) @ squares
        weights = masses.sum(axis=0, dtype=np.float64)
        return cls(weights, (masses.T @ samples).astype(np.float64), second.astype(np.float64))

    def plus(self, others: Moments) -> Moments:
        """The sums over these samples and others."""
        return Moments(self.weights + others.weights, self.first + others.first, self.second + others.second)

    def mixture(self, covariance_type: CovarianceType, floor: float) -> GaussianMixture:
        """The likeliest mixture; `floor` is added to each variance."""
        total = self.weights.sum()
        # An empty component keeps a vanishing weight, against a division by zero.
        weights = np.maximum(self.weights / total, 0) + 10 * np.finfo(float).tiny ** 0.5
        means, second = self.first / total / weights[:, None], self.second / total
        dimension = means.shape[1]
        covariances: FloatArray
        if covariance_type == "tied":
            covariances = second - (means * weights[:, None]).T @ means
            covariances = (covariances + covariances.T) / 2 + floor * np.eye(dimension)
            covariances = (1 - SHRINKAGE) * covariances + SHRINKAGE * np.diag(np.diag(covariances))
        elif covariance_type == "full":
            covariances = (
                second / weights[:, None, None] - means[:, :, None] * means[:, None] + floor * np.eye(dimension)
            )
        elif covariance_type == "shared":
            covariances = np.maximum(second - weights @ means**2, 0) + floor
        else:
            covariances = np.maximum(second / weights[:, None] - means**2, 0) + floor
            if covariance_type == "spherical":
                covariances = covariances.mean(axis=1)
        return GaussianMixture(covariance_type, weights / weights.sum(), means, covariances)


def _log_gaussians(
    samples: FloatArray,
    squares: FloatArray | None,
    means: FloatArray,
    covariances: FloatArray,
    covariance_type: CovarianceType,
) -> FloatArray:
    """(n, K) log-densities without the weights; `squares` are those of centered samples, None to compute them."""
    dimension = means.shape[1]
    if covariance_type == "tied":
        # Along axes on which the covariance is the unit matrix, distances are those of one spherical covariance.
        factor, center = np.linalg.cholesky(covariances), means.mean(axis=0)
        axes = solve_triangular(factor, np.eye(dimension), lower=True).T
        x, mu = ((samples - center) @ axes).astype(samples.dtype), (means - center) @ axes
        log_determinant = samples.dtype.type(np.log(np.diagonal(factor)).sum())
        return _log_gaussians(x, x**2, mu, np.ones(dimension), "shared") - log_determinant
    if covariance_type == "full":
        factors = np.linalg.cholesky(covariances)
        half_log_determinants = np.log(np.diagonal(factors, axis1=1, axis2=2)).sum(axis=1)
        distances = np.stack(
            [
                (solve_triangular(factor, (samples - mean).T, lower=True) ** 2).sum(axis=0)
                for factor, mean in zip(factors, means, strict=True)
            ],
            axis=1,
        )
    else:
        # (1, d) if components share it: terms that depend on the sample alone are then computed once for all.
        variances = covariances[:, None] if covariance_type == "spherical" else np.atleast_2d(covariances)
        half_log_determinants = np.log(np.broadcast_to(variances, (len(variances), dimension))).sum(axis=1) / 2
        # Σ (x − μ)² / v, expanded to two matrix products; samples are centered first, against cancellation.
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
    """The mixture with its components in the order of the mean of their means, largest first."""
    order = np.argsort(-mixture.means.mean(axis=1), kind="stable")
    per_component = mixture.covariance_type in ("diag", "spherical", "full")
    covariances = mixture.covariances[order] if per_component else mixture.covariances
    return GaussianMixture(mixture.covariance_type, mixture.weights[order], mixture.means[order], covariances)
