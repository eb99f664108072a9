"""Checks of the arrays of a model file beyond their shapes and ranges: whether they can be of one model at all.

Each raises a `DamagedError` that names what is wrong.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..message import Message
from .checked_json import DamagedError

FARTHEST_MEAN = 2.0
"""How far a mean may be, in units of the largest distance that is possible; fits reach 0.6 of it."""


def check_joins(joins: NDArray[Any], n_components: int) -> None:
    """Each join must be of two different groups that exist at this step; the joined group has the name of the first."""
    groups = set(range(n_components))
    for i, j in joins.tolist():
        if not (i in groups and j in groups and i != j):
            raise DamagedError(Message("joins has the pair {i:g}, {j:g}, which cannot be joined", i=i, j=j))
        groups.remove(j)


def check_groups(arrays: dict[str, NDArray[Any]], kind: str, n_components: int) -> None:
    """Each region must belong to one of the groups of its atlas."""
    groups, segment = float(arrays[f"{kind}_groups"]), arrays[f"{kind}_segment"]
    if (segment >= groups).any():
        raise DamagedError(
            Message("{name} has a number that is none of {groups:g} groups", name=f"{kind}_segment", groups=groups)
        )


def check_variances(covariances: NDArray[Any], covariance_type: str, least: float) -> None:
    """Variances must not be below the least one, and matrices must be positive definite."""
    matrices = covariance_type in ("tied", "full")
    variances = np.diagonal(covariances, axis1=-2, axis2=-1) if matrices else covariances
    if variances.min() < least:
        raise DamagedError("a variance is not positive, or far too small")
    if matrices and not (np.linalg.eigvalsh(covariances) > 0).all():
        raise DamagedError("a covariance matrix is not positive definite")


def check_means(arrays: dict[str, NDArray[Any]], parameters: dict[str, Any]) -> None:
    """No component may be farther away than its share of the standardized samples allows.

    Their mean is 0, and their variance 1, so that a component of weight w lies within 1 / √w. The paper's samples are
    signatures, which are not negative: a component lies within 1 / w of their mean.
    """
    weights = arrays["weights"][:, None]
    farthest = np.abs(arrays["centre"]) / weights if parameters["preset"] == "paper" else 1 / np.sqrt(weights)
    if (np.abs(arrays["means"]) > FARTHEST_MEAN * farthest).any():
        raise DamagedError("means has a number that is far too large for its weight")
