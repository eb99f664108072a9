"""Which model fits a shape: the paper's retrieval (section 5), between models of any settings.

A shape is of the class under whose mixture its signatures are likeliest: compared is
`PoseSegmentation.comparable_score`. Models of the same settings are compared by it as it is. Between those of other
settings, which describe shapes in other numbers, counts how far it is from what models of these settings give to their
own learned poses when they are left out. The same tells what is too little for any class.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from .mesh.triangle_mesh import FloatArray, IntArray
from .poses.pose_signature import PoseSignature
from .segmentation import PoseSegmentation

Verdict = Literal["sure", "unsure", "nothing fits"]
WIDTH = 0.15
"""Difference of two comparable scores at which one model is e times as probable as the other: so that, of answers with
some probability, about that share is right (Princeton classes, five choices of what is learned)."""
SURE = 0.95
"""Probability of the best model from which on it is sure."""
TOLERATED = 0.5
"""How far a score may lie below those that a model usually gives: few shapes of a class do, …"""
SPREADS = 3.0
"""… or how many of their standard deviations, if that is more."""


@dataclass(frozen=True)
class Rank:
    """A model in a ranking.

    Attributes
    ----------
    index : int
        Of the model among those that were ranked.
    score : float
        Mean of `PoseSegmentation.comparable_score` over the poses; 0 is what is usual for learned poses of models with
        these settings.
    probability : float
        Among the models of the ranking.
    fits : bool
        Whether the score is not far below those of the model's own poses.
    """

    index: int
    score: float
    probability: float
    fits: bool


@dataclass(frozen=True)
class Ranking:
    """Models, best first, and how sure that is."""

    ranks: tuple[Rank, ...]
    verdict: Verdict

    @property
    def best(self) -> Rank:
        """The model that fits best."""
        return self.ranks[0]


@dataclass(frozen=True)
class Retrieval:
    """What came of queries of several classes.

    Attributes
    ----------
    names : list of str
        Of the classes.
    confusion : (c, c) int array
        Queries of class i that were taken for class j.
    verdicts : dict
        For each verdict the numbers of right and of wrong answers.
    """

    names: list[str]
    confusion: IntArray
    verdicts: Mapping[str, tuple[int, int]]

    @property
    def right(self) -> int:
        """Queries that were taken for what they are."""
        return int(np.trace(self.confusion))

    @property
    def asked(self) -> int:
        """Queries."""
        return int(self.confusion.sum())

    @property
    def rate(self) -> float:
        """Share of right answers."""
        return self.right / self.asked


def described_alike(models: Sequence[PoseSegmentation]) -> list[list[int]]:
    """Indices of models together that take the same signature of a pose."""
    together: dict[tuple[object, ...], list[int]] = {}
    for i, model in enumerate(models):
        together.setdefault((*sorted(model.describing().items()), model.pieces), []).append(i)
    return list(together.values())


def rank(models: Sequence[PoseSegmentation], poses: Sequence[Sequence[PoseSignature]]) -> Ranking:
    """Say which models fit a shape.

    Parameters
    ----------
    models
        Fitted.
    poses
        For each model the poses of the shape, described by it, or by one that `described_alike` puts it together with.

    Raises
    ------
    ValueError
        If there is no model or no pose, or a signature is not by a model's settings.
    """
    if not models or len(models) != len(poses) or not all(len(of_model) for of_model in poses):
        raise ValueError(f"there are {len(models)} models, and poses for {sum(map(bool, map(len, poses)))} of them")
    scores = np.array([
        np.mean([model.comparable_score(pose) for pose in of_model])
        for model, of_model in zip(models, poses, strict=True)
    ])  # fmt: skip
    return ranking_of(scores, [model.usual_scores_ for model in models], [_settings(model) for model in models])


def ranking_of(scores: FloatArray, usual: Sequence[FloatArray], settings: Sequence[Hashable]) -> Ranking:
    """Of models' scores for a shape, those that each usually gives, and its settings."""
    fits = [score >= least_usual(of_model) for score, of_model in zip(scores, usual, strict=True)]
    levels: dict[Hashable, list[float]] = {each: [] for each in settings}
    for each, of_model in zip(settings, usual, strict=True):
        levels[each].append(float(np.mean(of_model)))
    above = scores - np.array([np.mean(levels[each]) for each in settings])
    weights = np.exp((above - above.max()) / WIDTH)
    ranks = tuple(
        Rank(int(i), float(above[i]), float(weights[i] / weights.sum()), bool(fits[i]))
        for i in np.argsort(-above, kind="stable")
    )
    if not ranks[0].fits:
        return Ranking(ranks, "nothing fits")
    return Ranking(ranks, "sure" if ranks[0].probability >= SURE else "unsure")


def _settings(model: PoseSegmentation) -> Hashable:
    """What scores depend on beside the class."""
    described = (*sorted(model.describing().items()), model.pieces, model.preset)
    return (*described, model.scaling, model.covariance_type, len(model.mixture_.weights))


def least_usual(usual: FloatArray) -> float:
    """The score below which a shape is of another class, given those of a model's own poses."""
    spread = float(np.std(usual, ddof=1)) if len(usual) > 1 else 0.0
    return float(np.mean(usual)) - max(TOLERATED, SPREADS * spread)


def spread_evenly(count: int, n_learned: int) -> list[int]:
    """Which of `count` shapes in a row are learned from: at equal steps, the first among them."""
    return [i * count // n_learned for i in range(n_learned)]


def retrieve(models: Mapping[str, PoseSegmentation], queries: Mapping[str, Sequence[PoseSignature]]) -> Retrieval:
    """Ask for the class of each query.

    Parameters
    ----------
    models
        Of each class, fitted, all with the same settings.
    queries
        Shapes of each class that were not learned, described by these settings.
    """
    names = list(models)
    confusion = np.zeros((len(names), len(names)), dtype=np.int64)
    verdicts = {verdict: [0, 0] for verdict in ("sure", "unsure", "nothing fits")}
    for i, name in enumerate(names):
        for query in queries[name]:
            found = rank(list(models.values()), [[query]] * len(names))
            confusion[i, found.best.index] += 1
            verdicts[found.verdict][int(found.best.index != i)] += 1
    return Retrieval(names, confusion, {verdict: (right, wrong) for verdict, (right, wrong) in verdicts.items()})
