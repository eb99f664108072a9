"""Standardization of signatures: the space that the mixture lives in, and densities that models share."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from ..mesh.triangle_mesh import FloatArray

Scaling = Literal["log", "raw"]

SIGNATURE_OFFSET = 1.0
"""Added to the signature, whose mean is 1, before its logarithm: values far below the mean change much from pose to
pose and say little, and tiny islands have next to no energy at low frequencies."""
LEAST_SPREAD = 1e-6
"""Lower bound of standard deviations: at a smaller one, single precision would lose the digits of a signature."""


@dataclass(frozen=True)
class Standardizer:
    """Scaling, centering and division by the standard deviation, fitted to the training samples.

        standardizer = Standardizer.fit(signature, shares, "log")
        samples = standardizer.transform(signature)  # mean 0 and standard deviation 1, weighted by the shares

    Attributes
    ----------
    scaling : "log" or "raw"
        Whether the logarithm of the signature enters the mixture, or the signature itself.
    mean, spread : (d,) arrays
        Mean and standard deviation of the scaled training samples.
    """

    scaling: Scaling
    mean: FloatArray
    spread: FloatArray

    @classmethod
    def fit(
        cls, signature: FloatArray, shares: FloatArray, scaling: Scaling, unit_spread: bool = False
    ) -> Standardizer:
        """Mean and standard deviation of samples.

        Parameters
        ----------
        signature : (n, d) array
        shares : (n,) array
            Weights of the samples, which sum to 1.
        scaling : "log" or "raw"
        unit_spread : bool
            Center only, as in the paper.
        """
        samples = _scaled(signature, scaling).astype(np.float64)
        mean = shares @ samples
        spread = np.maximum(np.sqrt(shares @ (samples - mean) ** 2), LEAST_SPREAD)
        return cls(scaling, mean, np.ones_like(spread) if unit_spread else spread)

    @property
    def n_energies(self) -> int:
        """Number of energies of the signatures."""
        return len(self.mean)

    def transform(self, signature: FloatArray, dtype: Any = None) -> FloatArray:
        """(n, d) standardized samples of a signature, in its own precision if no other is given."""
        scaled = _scaled(signature, self.scaling)
        if dtype is not None:
            scaled = scaled.astype(dtype)
        return np.asarray((scaled - self.mean.astype(scaled.dtype)) / self.spread.astype(scaled.dtype))

    @property
    def log_volume(self) -> float:
        """Logarithm of the volume that a unit of standardized space takes in scaled space.

        Subtracted from a log-density of standardized samples, it gives the log-density of the scaled signature, which
        can be compared between models with the same scaling.
        """
        return float(np.log(self.spread).sum())

    def comparable_densities(self, log_likelihoods: FloatArray, signature: FloatArray) -> FloatArray:
        """(n,) log-densities of the logarithm of a signature, which can be compared between all models.

        Parameters
        ----------
        log_likelihoods : (n,) array
            Log-densities of the standardized samples.
        signature : (n, d) array
        """
        densities = log_likelihoods - self.log_volume
        if self.scaling == "raw":
            densities = densities + np.log(signature + SIGNATURE_OFFSET).sum(axis=1)
        return densities


def _scaled(signature: FloatArray, scaling: Scaling) -> FloatArray:
    """A new array, or the signature itself."""
    return np.log(signature + SIGNATURE_OFFSET) if scaling == "log" else signature
