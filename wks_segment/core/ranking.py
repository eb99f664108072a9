"""Which model fits a shape: the retrieval of the paper (section 5), between models of any settings.

A shape belongs to the class under whose mixture its signatures are likeliest, by `PoseSegmentation.comparable_score`.
Scores of models with the same settings are compared directly. Models with other settings describe shapes by other
numbers; between them, each score is compared with the scores that models of these settings usually give to their own
learned poses when these are left out. The usual scores also tell when a shape fits no class.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from .mesh.triangle_mesh import FloatArray, IntArray
from .message import Message
from .poses.arguments import as_list
from .poses.pose_signature import PoseSignature
from .segmentation import PoseSegmentation
from .threads import one_blas_thread

Verdict = Literal["sure", "unsure", "nothing fits"]
SCORE_WIDTH = 0.1
"""Difference of two comparable scores at which one model is e times as probable as the other. With it, of the answers
with some probability about this share is right (Princeton classes, five choices of learned shapes)."""
SURE_PROBABILITY = 0.95
"""Probability above which the best model counts as sure."""
TOLERATED_DIFFERENCE = 0.5
"""A shape fits a model if its score is at most this much below the scores that the model usually gives …"""
TOLERATED_DEVIATIONS = 3.0
"""… or at most this many of their standard deviations, if that is more."""


@dataclass(frozen=True)
class Rank:
    """A model in a ranking.

    Attributes
    ----------
    index : int
        Index of the model among the ranked ones.
    score : float
        Mean of `PoseSegmentation.comparable_score` over the poses, minus the usual score of learned poses of models
        with the same settings.
    probability : float
        Probability among the models of the ranking.
    fits : bool
        Whether the score is not far below the scores of the model's own poses.

    Examples
    --------
    >>> from wks_segment.core import Rank, Ranking
    >>> Ranking((Rank(1, -0.1, 0.98, True), Rank(0, -0.9, 0.02, False)), "sure").ranks[0].index  # as `rank` gives it
    1
    """

    index: int
    score: float
    probability: float
    fits: bool


@dataclass(frozen=True)
class Ranking:
    """Models, best first, and a verdict on the best one.

    Examples
    --------
    >>> from wks_segment.core import Rank, Ranking
    >>> ranking = Ranking((Rank(1, -0.1, 0.98, True), Rank(0, -0.9, 0.02, False)), "sure")  # as `rank` gives it
    >>> [model.index for model in ranking.ranks], ranking.verdict
    ([1, 0], 'sure')
    """

    ranks: tuple[Rank, ...]
    verdict: Verdict

    @property
    def best(self) -> Rank:
        """The model that fits best."""
        return self.ranks[0]


@dataclass(frozen=True)
class Retrieval:
    """Results of queries from several classes.

    Attributes
    ----------
    names : list of str
        Names of the classes.
    confusion : (c, c) int array
        Number of queries of class i that were taken for class j.
    verdicts : dict
        For each verdict the numbers of right and of wrong answers.

    Examples
    --------
    >>> import numpy as np
    >>> from wks_segment.core import Retrieval
    >>> verdicts = {"sure": (7, 7), "unsure": (0, 1)}
    >>> found = Retrieval(["cat", "dog"], np.array([[3, 1], [0, 4]]), verdicts)  # as `retrieve` gives it
    >>> int(np.trace(found.confusion))  # right answers
    7
    """

    names: list[str]
    confusion: IntArray
    verdicts: Mapping[str, tuple[int, int]]

    @property
    def right(self) -> int:
        """Number of queries that were assigned to their own class."""
        return int(np.trace(self.confusion))

    @property
    def asked(self) -> int:
        """Number of queries."""
        return int(self.confusion.sum())

    @property
    def rate(self) -> float:
        """Share of right answers."""
        return self.right / self.asked


def described_alike(models: Sequence[PoseSegmentation]) -> list[list[int]]:
    """Indices of models in groups; the models of a group take the same signature of a pose.

    Examples
    --------
    >>> from wks_segment.core import PoseSegmentation, described_alike
    >>> described_alike([PoseSegmentation(), PoseSegmentation(n_segments=5), PoseSegmentation(n_eigenpairs=100)])
    [[0, 1], [2]]
    """
    groups: dict[tuple[object, ...], list[int]] = {}
    for i, model in enumerate(models):
        groups.setdefault((*sorted(model.describing().items()), model.pieces), []).append(i)
    return list(groups.values())


@one_blas_thread
def rank(models: Iterable[PoseSegmentation], poses: Iterable[Iterable[PoseSignature]]) -> Ranking:
    """Rank models by how well they fit a shape.

        ranking = rank(models, [[model.describe(mesh)] for model in models])
        if ranking.verdict != "nothing fits":
            labels = models[ranking.best.index].segment_faces(mesh)

    Parameters
    ----------
    models
        Fitted models.
    poses
        For each model the poses of the shape, described by this model, or by another one of its group in
        `described_alike`.

    Raises
    ------
    ValueError
        If there is no model or no pose, or a signature was made with other settings than those of the model.

    Examples
    --------
    >>> from examples.tube import tube
    >>> from wks_segment.core import PoseSegmentation, rank
    >>> thin, short = (
    ...     PoseSegmentation(n_segments=2, n_eigenpairs=40).fit([tube(0.2, length), tube(0.8, length)])
    ...     for length in (4.0, 1.5)
    ... )
    >>> pose = thin.describe_all([tube(0.5)])
    >>> rank([short, thin], [pose, pose]).ranks[0].index  # the second model fits best
    1
    """
    models, poses = as_list(models, "models"), [as_list(described, "poses") for described in as_list(poses, "poses")]
    if not models or len(models) != len(poses) or not all(poses):
        raise ValueError(
            Message(
                "there are {models} models, and poses for {described} of them",
                models=len(models),
                described=sum(map(bool, poses)),
            )
        )
    scores = np.array([
        np.mean([model.comparable_score(pose) for pose in described])
        for model, described in zip(models, poses, strict=True)
    ])  # fmt: skip
    return ranking_of(scores, [model.usual_scores_ for model in models], [_settings(model) for model in models])


def ranking_of(scores: FloatArray, usual: Sequence[FloatArray], settings: Sequence[Hashable]) -> Ranking:
    """Ranking by the score of a shape, the usual scores and the settings of each model."""
    fits = [score >= least_usual(of_model) for score, of_model in zip(scores, usual, strict=True)]
    means_by_settings: dict[Hashable, list[float]] = {}
    for setting, of_model in zip(settings, usual, strict=True):
        means_by_settings.setdefault(setting, []).append(float(np.mean(of_model)))
    relative = scores - np.array([np.mean(means_by_settings[setting]) for setting in settings])
    weights = np.exp((relative - relative.max()) / SCORE_WIDTH)
    ranks = tuple(
        Rank(int(i), float(relative[i]), float(weights[i] / weights.sum()), bool(fits[i]))
        for i in np.argsort(-relative, kind="stable")
    )
    if not ranks[0].fits:
        return Ranking(ranks, "nothing fits")
    return Ranking(ranks, "sure" if ranks[0].probability >= SURE_PROBABILITY else "unsure")


def _settings(model: PoseSegmentation) -> Hashable:
    """Everything besides the class that scores depend on."""
    described = (*sorted(model.describing().items()), model.pieces, model.preset)
    return (*described, model.scaling, model.mixture_.covariance_type)


def least_usual(usual: FloatArray) -> float:
    """Score below which a shape belongs to another class, given the usual scores of a model."""
    deviation = float(np.std(usual, ddof=1)) if len(usual) > 1 else 0.0
    return float(np.mean(usual)) - max(TOLERATED_DIFFERENCE, TOLERATED_DEVIATIONS * deviation)


def spread_evenly(count: int, n_learned: int) -> list[int]:
    """Indices of the shapes to learn from, at equal steps among `count` shapes, beginning with the first."""
    return [i * count // n_learned for i in range(n_learned)]


def retrieve(models: Mapping[str, PoseSegmentation], queries: Mapping[str, Sequence[PoseSignature]]) -> Retrieval:
    """Find the class of each query.

    Parameters
    ----------
    models
        Fitted model of each class, all with the same settings.
    queries
        Shapes of each class that were not learned, described with these settings.

    Examples
    --------
    >>> from examples.tube import tube
    >>> from wks_segment.core import PoseSegmentation, retrieve
    >>> thin, short = (
    ...     PoseSegmentation(n_segments=2, n_eigenpairs=40).fit([tube(0.2, length), tube(0.8, length)])
    ...     for length in (4.0, 1.5)
    ... )
    >>> queries = {"thin": thin.describe_all([tube(0.5)]), "short": short.describe_all([tube(0.5, 1.5)])}
    >>> retrieve({"thin": thin, "short": short}, queries).confusion.tolist()
    [[1, 0], [0, 1]]
    """
    names = list(models)
    confusion = np.zeros((len(names), len(names)), dtype=np.int64)
    verdicts = {verdict: [0, 0] for verdict in ("sure", "unsure", "nothing fits")}
    for i, name in enumerate(names):
        for query in queries[name]:
            ranking = rank(list(models.values()), [[query]] * len(names))
            confusion[i, ranking.best.index] += 1
            verdicts[ranking.verdict][int(ranking.best.index != i)] += 1
    return Retrieval(names, confusion, {verdict: (right, wrong) for verdict, (right, wrong) in verdicts.items()})
