"""Parameters of a model: names, allowed values, and the preset that overrides some of them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal, Self, get_args

import numpy as np

from ..mesh.surface import IslandMode
from ..message import Message
from ..spectral.eigenpairs import Accuracy
from ..spectral.intrinsic_delaunay import Laplacian
from .gaussian_mixture import CovarianceType
from .standardizer import Scaling

Preset = Literal["default", "paper"]
NSegments = int | Literal["auto"]

PARAMETERS = (
    "n_segments", "covariance_type", "n_eigenpairs", "n_energies", "accuracy", "random_state", "scaling",
    "pieces", "laplacian", "smoothness", "preset",
)  # fmt: skip
"""Names of all parameters, in the order of the model file."""
PAPER: Mapping[str, Any] = {
    "covariance_type": "diag", "scaling": "raw", "laplacian": "cotangent", "smoothness": 0.0,
}  # fmt: skip
"""Values of `preset="paper"`: a mixture of the signatures themselves, started once, whose components are the labels."""
MOST_SMOOTHNESS = 10
"""Upper bound of the smoothness: the smoothing length there, 0.3, is larger than most limbs."""
_LEAST = {"n_segments": 1, "n_eigenpairs": 3, "n_energies": 2, "random_state": 0}
_CHOICES = {
    "covariance_type": ("auto", *get_args(CovarianceType)),
    "accuracy": get_args(Accuracy),
    "scaling": get_args(Scaling),
    "pieces": get_args(IslandMode),
    "laplacian": ("auto", *get_args(Laplacian)),
    "preset": get_args(Preset),
}


class Estimator:
    """What scikit-learn expects of an estimator. Its own base class takes 1.6 s of a processor to import."""

    def get_params(self, deep: bool = True) -> dict[str, Any]:
        """Name and value of each parameter; `deep` is for estimators that contain others."""
        return {name: getattr(self, name) for name in PARAMETERS}

    def set_params(self, **parameters: Any) -> Self:
        """Set parameters, which are checked by `fit`; ValueError if there is none of a name."""
        for name, value in parameters.items():
            if name not in PARAMETERS:
                raise ValueError(
                    Message("there is no parameter {name!r}, only {known}", name=name, known=", ".join(PARAMETERS))
                )
            setattr(self, name, value)
        return self

    def __repr__(self) -> str:
        usual = type(self)().get_params()
        changed = (f"{name}={value!r}" for name, value in self.get_params().items() if value != usual[name])
        return f"{type(self).__name__}({', '.join(changed)})"

    def __sklearn_tags__(self) -> Any:
        """For functions of scikit-learn that take an estimator."""
        from sklearn.base import BaseEstimator

        return BaseEstimator().__sklearn_tags__()


def effective(parameters: Mapping[str, Any], name: str) -> Any:
    """Value of a parameter after the preset."""
    return PAPER[name] if parameters["preset"] == "paper" and name in PAPER else parameters[name]


def least_segments(n_segments: NSegments) -> int:
    """Smallest number of segments that a parameter `n_segments` allows: itself, or 2 for "auto"."""
    return 2 if n_segments == "auto" else n_segments


def check_parameters(parameters: Mapping[str, Any]) -> None:
    """Raise ValueError, with the name and the value, if a parameter is out of range."""
    open_number = parameters["n_segments"] == "auto"
    if open_number and parameters["preset"] == "paper":
        raise ValueError('n_segments must be a number with preset="paper": "auto" needs the default preset')
    for name, least in _LEAST.items():
        value = parameters[name]
        if name == "n_segments" and open_number:
            continue
        if not isinstance(value, int | np.integer) or value < least:
            raise ValueError(
                Message(
                    "{name} must be a whole number of at least {least}, not {value!r}",
                    name=name,
                    least=least,
                    value=value,
                )
            )
    smoothness = parameters["smoothness"]
    if not isinstance(smoothness, int | float) or not 0 <= smoothness <= MOST_SMOOTHNESS:
        raise ValueError(
            Message(
                "smoothness must be a number from 0 to {most}, not {value!r}", most=MOST_SMOOTHNESS, value=smoothness
            )
        )
    for name, allowed in _CHOICES.items():
        if parameters[name] not in allowed:
            raise ValueError(
                Message(
                    "{name} must be one of {choices}, not {value!r}",
                    name=name,
                    choices=", ".join(allowed),
                    value=parameters[name],
                )
            )
