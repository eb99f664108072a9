import numpy as np
import pytest

from wks_segment.core.learning.standardizer import SIGNATURE_OFFSET, Standardizer

SIGNATURE = np.random.default_rng(0).gamma(2.0, 0.5, (500, 3))
SHARES = np.random.default_rng(1).random(500)
SHARES /= SHARES.sum()


@pytest.mark.parametrize("scaling", ["log", "raw"])
def test_weighted_samples_have_mean_zero_and_deviation_one(scaling):
    samples = Standardizer.fit(SIGNATURE, SHARES, scaling).transform(SIGNATURE)
    np.testing.assert_allclose(SHARES @ samples, 0, atol=1e-12)
    np.testing.assert_allclose(SHARES @ samples**2, 1)


def test_unit_spread_only_centers():
    standardizer = Standardizer.fit(SIGNATURE, SHARES, "raw", unit_spread=True)
    np.testing.assert_allclose(standardizer.transform(SIGNATURE), SIGNATURE - SHARES @ SIGNATURE)
    assert standardizer.log_volume == 0


def test_constant_energy_is_not_divided_by_zero():
    constant = np.ones((10, 2))
    standardizer = Standardizer.fit(constant, np.full(10, 0.1), "log")
    np.testing.assert_allclose(standardizer.transform(constant), 0, atol=1e-6)


def test_precision_of_the_signature_is_kept_unless_another_is_given():
    standardizer = Standardizer.fit(SIGNATURE, SHARES, "log")
    single = SIGNATURE.astype(np.float32)
    assert standardizer.transform(single).dtype == np.float32
    assert standardizer.transform(single, np.float64).dtype == np.float64


def test_comparable_density_does_not_depend_on_the_scaling():
    # A density p of the raw signature x is the density p (x + offset) of log(x + offset).
    log_density = -SIGNATURE.sum(axis=1)
    log_of_logarithm = log_density + np.log(SIGNATURE + SIGNATURE_OFFSET).sum(axis=1)
    for scaling, scaled in (("raw", log_density), ("log", log_of_logarithm)):
        standardizer = Standardizer.fit(SIGNATURE, SHARES, scaling)
        found = standardizer.comparable_densities(scaled + standardizer.log_volume, SIGNATURE)
        np.testing.assert_allclose(found, log_of_logarithm)
