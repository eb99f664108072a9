from typing import get_args

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from wks_segment.core import fit_mixture
from wks_segment.core.learning.gaussian_mixture import (
    BLOCK_ROWS,
    SHRINKAGE,
    CovarianceType,
    GaussianMixture,
    Moments,
    maximize,
    squares_of,
    variance_floor,
)

MEANS = np.array([[4.0, 4.0, 0.0], [0.0, 0.0, 0.0], [-5.0, 1.0, 2.0]])
SHARES = np.array([0.5, 0.3, 0.2])
TYPES = get_args(CovarianceType)


def drawn(n=6000, spread=(0.8, 0.8, 0.8), seed=0):
    generator = np.random.default_rng(seed)
    component = generator.choice(3, n, p=SHARES)
    return MEANS[component] + np.asarray(spread) * generator.standard_normal((n, 3)), component


@pytest.mark.parametrize("covariance_type", TYPES)
def test_a_mixture_is_recovered_from_its_own_samples(covariance_type):
    samples, component = drawn()
    mixture = fit_mixture(samples, np.ones(len(samples)), 3, covariance_type)
    # Components are sorted by the mean of their means, like MEANS.
    np.testing.assert_allclose(mixture.means, MEANS, atol=0.08)
    np.testing.assert_allclose(mixture.weights, SHARES, atol=0.03)
    assert (mixture.posteriors(samples).argmax(axis=1) == component).mean() > 0.99


def test_variances_are_recovered():
    samples, _ = drawn(spread=(0.5, 1.0, 0.25))
    for covariance_type in ("shared", "diag"):
        mixture = fit_mixture(samples, np.ones(len(samples)), 3, covariance_type)
        expected = np.broadcast_to([0.25, 1.0, 0.0625], mixture.covariances.shape)
        np.testing.assert_allclose(mixture.covariances, expected, rtol=0.12, atol=0.02)


def full_covariance(mixture, k):
    c = mixture.covariances
    if mixture.covariance_type in ("tied", "full"):
        return c if mixture.covariance_type == "tied" else c[k]
    return np.diag(np.broadcast_to(c if mixture.covariance_type == "shared" else c[k], 3))


@pytest.mark.parametrize("covariance_type", TYPES)
def test_likelihood_is_that_of_the_normal_density(covariance_type):
    samples, _ = drawn(400)
    mixture = fit_mixture(samples, np.ones(len(samples)), 3, covariance_type)
    covariances = [full_covariance(mixture, k) for k in range(3)]
    density = sum(
        mixture.weights[k] * multivariate_normal.pdf(samples, mixture.means[k], covariances[k]) for k in range(3)
    )
    np.testing.assert_allclose(mixture.log_likelihoods(samples), np.log(density), rtol=1e-8)
    np.testing.assert_allclose(mixture.posteriors(samples).sum(axis=1), 1.0)


GROUP = np.array([1, 0, 1])
"""Of the components of MEANS."""


def densities(mixture, samples):
    """(n, 3) weight times density of each component, by SciPy."""
    return np.stack(
        [
            mixture.weights[k] * multivariate_normal.pdf(samples, mixture.means[k], full_covariance(mixture, k))
            for k in range(3)
        ],
        axis=1,
    )


@pytest.mark.parametrize("covariance_type", TYPES)
def test_posteriors_of_groups_are_sums_over_their_components(covariance_type):
    samples, _ = drawn(400)
    mixture = fit_mixture(samples, np.ones(len(samples)), 3, covariance_type)
    of_components = densities(mixture, samples)
    expected = np.stack([of_components[:, 1], of_components[:, 0] + of_components[:, 2]], axis=1)
    expected /= expected.sum(axis=1, keepdims=True)
    found = mixture.group_posteriors(samples, GROUP, 2)
    assert found.dtype == np.float32
    np.testing.assert_allclose(found, expected, atol=1e-6)
    # A group without components has no share.
    more = mixture.group_posteriors(samples, GROUP, 4)
    np.testing.assert_array_equal(more, np.pad(found, ((0, 0), (0, 2))))


def test_posteriors_of_groups_do_not_depend_on_the_blocks(monkeypatch):
    samples, _ = drawn(1000)
    mixture = fit_mixture(samples, np.ones(len(samples)), 3, "diag")
    expected = mixture.group_posteriors(samples, GROUP, 2)
    assert len(samples) < BLOCK_ROWS
    monkeypatch.setattr("wks_segment.core.learning.gaussian_mixture.BLOCK_ROWS", 300)
    np.testing.assert_allclose(mixture.group_posteriors(samples, GROUP, 2), expected, atol=1e-6)
    assert mixture.group_posteriors(samples[:0], GROUP, 2).shape == (0, 2)


@pytest.mark.parametrize("covariance_type", TYPES)
def test_log_likelihoods_of_groups_are_those_of_mixtures_of_their_own(covariance_type):
    samples, _ = drawn(400)
    mixture = fit_mixture(samples, np.ones(len(samples)), 3, covariance_type)
    of_components = densities(mixture, samples)
    alone = of_components[:, 1] / mixture.weights[1]
    together = (of_components[:, 0] + of_components[:, 2]) / (mixture.weights[0] + mixture.weights[2])
    found = mixture.group_log_likelihoods(samples, GROUP, 2)
    np.testing.assert_allclose(found, np.log(np.stack([alone, together], axis=1)), rtol=1e-8, atol=1e-8)
    # One group of all is the mixture itself.
    of_all = mixture.group_log_likelihoods(samples, np.zeros(3, dtype=int), 1)
    np.testing.assert_allclose(of_all[:, 0], mixture.log_likelihoods(samples), rtol=1e-10)


def test_log_likelihoods_of_groups_are_finite_far_away():
    mixture = GaussianMixture("tied", SHARES, MEANS, 0.01 * np.eye(3))
    found = mixture.group_log_likelihoods(np.array([(1e3, 0, 0), (4.0, 4.0, 0.0)]), GROUP, 2)
    assert np.isfinite(found).all()
    assert found[1, 1] - found[1, 0] > 600


@pytest.mark.parametrize("covariance_type", TYPES)
def test_a_mixture_of_given_shares_is_that_of_plain_formulas(covariance_type):
    samples = drawn(300, (0.5, 1.0, 0.25))[0] @ np.array([(1, 0.4, 0), (0, 1, -0.3), (0, 0, 1)])
    generator = np.random.default_rng(1)
    masses = generator.random((300, 3)) ** 3
    masses /= masses.sum()
    floor = 0.01
    found = maximize(samples, squares_of(samples, covariance_type), masses, covariance_type, floor)
    weights = masses.sum(axis=0)
    means = np.stack([np.average(samples, axis=0, weights=mass) for mass in masses.T])
    full = np.stack([np.cov(samples.T, aweights=mass, ddof=0) + floor * np.eye(3) for mass in masses.T])
    tied = np.einsum("k,kij->ij", weights, full)
    shrunk = (1 - SHRINKAGE) * tied + SHRINKAGE * np.diag(np.diagonal(tied))
    expected = {
        "full": full, "tied": shrunk, "shared": np.diagonal(tied), "diag": np.diagonal(full, axis1=1, axis2=2),
        "spherical": np.diagonal(full, axis1=1, axis2=2).mean(axis=1),
    }[covariance_type]  # fmt: skip
    np.testing.assert_allclose(found.weights, weights)
    np.testing.assert_allclose(found.means, means, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(found.covariances, expected, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("covariance_type", TYPES)
def test_moments_of_two_sets_of_samples_add_up(covariance_type):
    samples, _ = drawn(300)
    masses = np.random.default_rng(1).random((300, 3))
    first, second = (
        Moments.of(samples[part], squares_of(samples[part], covariance_type), masses[part], covariance_type)
        for part in (slice(100), slice(100, None))
    )
    found = first.plus(second).mixture(covariance_type, 0.01)
    whole = maximize(samples, squares_of(samples, covariance_type), masses / masses.sum(), covariance_type, 0.01)
    for name in ("weights", "means", "covariances"):
        np.testing.assert_allclose(getattr(found, name), getattr(whole, name), rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("covariance_type", TYPES)
def test_a_component_without_samples_is_finite(covariance_type):
    samples, _ = drawn(50)
    masses = np.zeros((50, 3))
    masses[:, :2] = 0.01
    mixture = maximize(samples, squares_of(samples, covariance_type), masses, covariance_type, 0.01)
    assert np.isfinite(mixture.covariances).all()
    posteriors = mixture.posteriors(samples)
    np.testing.assert_allclose(posteriors, [[0.5, 0.5, 0]] * 50, atol=1e-9)


def test_the_floor_of_variances_is_a_share_of_their_mean():
    samples, _ = drawn(500)
    shares = np.linspace(1, 2, 500)
    shares /= shares.sum()
    variances = [np.cov(column, aweights=shares, ddof=0) for column in samples.T]
    assert variance_floor(samples, shares) == pytest.approx(1e-3 * np.mean(variances))


def test_sample_with_double_weight_counts_like_two():
    samples, _ = drawn(500)
    weights = np.where(samples[:, 0] > 0, 2.0, 1.0)
    weighted = fit_mixture(samples, weights, 3, "diag")
    repeated_samples = np.repeat(samples, weights.astype(int), axis=0)
    repeated = fit_mixture(repeated_samples, np.ones(len(repeated_samples)), 3, "diag")
    np.testing.assert_allclose(weighted.means, repeated.means, atol=0.02)
    np.testing.assert_allclose(weighted.weights, repeated.weights, atol=0.005)


@pytest.mark.parametrize("covariance_type", TYPES)
def test_component_cannot_collapse_onto_equal_samples(covariance_type):
    # Three distinct samples, which differ in one of 40 dimensions: every covariance without a floor is singular.
    samples = np.zeros((300, 40))
    samples[:, 7] = np.repeat([0.0, 1.0, 2.0], 100)
    mixture = fit_mixture(samples, np.ones(300), 3, covariance_type)
    assert np.isfinite(mixture.log_likelihoods(samples)).all()
    assert mixture.posteriors(samples).max(axis=1).min() > 0.9


def test_too_many_components_are_refused():
    samples = np.repeat([[0.0], [1.0]], 50, axis=0)
    with pytest.raises(ValueError, match="3 components are too many"):
        fit_mixture(samples, np.ones(100), 3)


def test_unknown_covariance_is_refused():
    with pytest.raises(ValueError, match="covariance_type must be one of"):
        fit_mixture(np.zeros((5, 2)), np.ones(5), 2, "round")


def test_the_same_seed_gives_the_same_mixture():
    samples, _ = drawn(2000)
    a, b = (fit_mixture(samples, np.ones(len(samples)), 4, random_state=5) for _ in range(2))
    np.testing.assert_array_equal(a.means, b.means)
