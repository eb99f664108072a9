from typing import get_args

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from wks_segment.core import fit_mixture
from wks_segment.core.learning.gaussian_mixture import CovarianceType

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
