"""Choice of a mixture over several poses, and of the components that make each segment."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..mesh.adjacency import connected_regions
from ..message import Message, message_of
from ..poses.pose_signature import PoseSignature
from ..poses.signature_cache import Cache
from ..progress import Progress
from .candidates import Candidate, CandidateSet, candidates_key
from .gaussian_mixture import CovarianceType, GaussianMixture, TooFewSamplesError, fit_mixtures
from .merge_tree import MergeTree
from .parameters import NSegments, effective, least_segments
from .training_samples import TrainingSamples

AUTO_TYPES: tuple[CovarianceType, ...] = ("shared", "diag")
"""Covariance types that `covariance_type="auto"` tries on several poses; on one pose it takes the first."""
CANDIDATES_PER_TYPE = 4
"""Number of mixtures of each covariance type that are compared."""
MUST_FALL_TO = 0.8
"""The disagreement of labels between poses must fall to less than this fraction of that of the first covariance type
for another type to be chosen: more parameters must earn their place."""
MERGING_ROUNDS = 5
"""Maximum number of times that components are merged again, each time with the components of scattered segments first;
each round can scatter other segments."""
LEAST_COMPONENTS, PER_SEGMENT, MOST_MORE = 24, 3, 64
"""The mixture has `PER_SEGMENT` components for each segment, but at least `LEAST_COMPONENTS`, and at most `MOST_MORE`
more than segments: with fewer, borders that people would draw are missing; with more, a fit takes longer."""
FITTING_SHARE = 3 / 7
"""Share of the time of learning a mixture that fitting the candidates takes; the rest is evaluating them."""
MIN_SHARE = 0.005
"""Default share of the area that a connected region must have to keep its label."""


@dataclass(frozen=True)
class CandidatePlan:
    """Which mixtures to fit: with more components than segments, which are merged later.

    Attributes
    ----------
    training : TrainingSamples
    n_segments : int or "auto"
        As for `PoseSegmentation`. Mixtures of type "tied" or "full" have one component for each segment (a fixed few
        if this is "auto"); more would take minutes and overfit.
    covariance_types
        The types to try.
    """

    training: TrainingSamples
    n_segments: NSegments
    covariance_types: Sequence[CovarianceType]

    def candidates(
        self,
        poses: Sequence[PoseSignature],
        cache: Cache | None,
        fitting: Progress,
        evaluating: Progress,
    ) -> CandidateSet:
        """Fit the mixtures and evaluate them on the training poses.

        Parameters
        ----------
        poses
            The training poses.
        cache : Cache or None
            Searched first, for candidates of any number of segments that has as many components; new candidates are
            added to it.
        fitting, evaluating : Progress
            Of the two steps.
        """
        key = ""
        if cache is not None:
            counts = [self._n_components(kind) for kind in self.covariance_types]
            settings = [self.training.standardizer.scaling, *zip(self.covariance_types, counts, strict=True)]
            key = candidates_key(poses, settings)
            try:
                return CandidateSet.of_arrays(poses, cache.arrays(key) or {})
            except (KeyError, ValueError):  # not cached, or damaged
                fitting(0.0)
        mixtures = self._mixtures(fitting)
        candidates = CandidateSet.of(poses, mixtures, self.training.standardizer, evaluating)
        # A mixture with fewer components than planned depends on the number of segments, which is not in the key.
        if cache is not None and all(
            len(mixture.weights) == self._n_components(mixture.covariance_type) for mixture in mixtures
        ):
            try:
                cache.keep(key, candidates.arrays())
            except OSError as error:
                warnings.warn(
                    Message("mixtures were not kept for the next time: {reason}", reason=message_of(error)),
                    stacklevel=2,
                )
        return candidates

    def _n_components(self, covariance_type: CovarianceType) -> int:
        wanted = least_segments(self.n_segments)
        if covariance_type in ("tied", "full"):
            return max(wanted, LEAST_COMPONENTS // PER_SEGMENT) if self.n_segments == "auto" else wanted
        return min(max(LEAST_COMPONENTS, PER_SEGMENT * wanted), wanted + MOST_MORE, len(self.training.shares))

    def _mixtures(self, progress: Progress) -> list[GaussianMixture]:
        samples, shares = self.training.standardized, self.training.shares
        mixtures = []
        for kind, step in progress.never_falling().each(self.covariance_types):
            count = self._n_components(kind)
            try:
                mixtures += fit_mixtures(samples, shares, count, kind, None, CANDIDATES_PER_TYPE, step)
            except TooFewSamplesError as error:
                # A cube has at most three distinct signatures, and so at most three components.
                count = max(least_segments(self.n_segments), error.distinct)
                mixtures += fit_mixtures(samples, shares, count, kind, None, CANDIDATES_PER_TYPE, step)
        return mixtures


def mixture_and_merge_tree(
    parameters: Mapping[str, Any],
    poses: Sequence[PoseSignature],
    training: TrainingSamples,
    cache: Cache | None,
    progress: Progress,
) -> tuple[GaussianMixture, MergeTree | None]:
    """The best candidate for the parameters of a model; with the paper's setting one mixture without a merge tree."""
    n_segments, covariance_type = parameters["n_segments"], effective(parameters, "covariance_type")
    fitting, evaluating = progress.part(0.0, FITTING_SHARE, "mixture"), progress.part(FITTING_SHARE, 1.0, "evaluating")
    if parameters["preset"] == "paper":
        samples, shares = training.standardized, training.shares
        return fit_mixtures(samples, shares, n_segments, covariance_type, parameters["random_state"], 1, fitting)[
            0
        ], None
    types = AUTO_TYPES[: len(poses)] if covariance_type == "auto" else (covariance_type,)
    candidates = CandidatePlan(training, n_segments, types).candidates(poses, cache, fitting, evaluating)
    return best_candidate(candidates, n_segments)


def best_candidate(candidates: CandidateSet, n_segments: NSegments) -> tuple[GaussianMixture, MergeTree]:
    """The best mixture for a number of segments, and its merge tree.

    Of several poses of one mesh it is the mixture whose labels agree best between the poses; of several meshes, the
    mixture whose regions are most like reference cuts of each mesh by geometry; of a single pose, the mixture that is
    most certain.
    """
    several = candidates.members
    trees = [MergeTree.of(candidate.contacts) for candidate in several]
    if len(candidates.geometries) > 1 and not candidates.one_mesh:
        # Final regions are compared: meshes differ more than poses in which components are scattered.
        trees = [
            _without_scattered(candidates, candidate, tree, n_segments)
            for candidate, tree in zip(several, trees, strict=True)
        ]
        losses = [
            _rand_error(candidates, candidate, tree, n_segments) for candidate, tree in zip(several, trees, strict=True)
        ]
        best = int(np.argmin(losses))
        return several[best].mixture, trees[best]
    if candidates.one_mesh:
        first_type = several[0].mixture.covariance_type
        losses = [
            _disagreement(candidate, tree, n_segments)
            / (1 if candidate.mixture.covariance_type == first_type else MUST_FALL_TO)
            for candidate, tree in zip(several, trees, strict=True)
        ]
    else:
        losses = [-float(tree.certainties[tree.number_of(n_segments) - 1]) for tree in trees]
    best = int(np.argmin(losses))
    return several[best].mixture, _without_scattered(candidates, several[best], trees[best], n_segments)


def _rand_error(candidates: CandidateSet, candidate: Candidate, tree: MergeTree, n_segments: NSegments) -> float:
    """Mean over the poses of the Rand-index error of the regions against the reference cuts."""
    group = tree.groups(tree.number_of_wholes(tree.number_of(n_segments)))
    poses = zip(candidates.geometries, candidate.likeliest, strict=True)
    return float(np.mean([geometry.rand_error(group[components]) for geometry, components in poses]))


def _disagreement(candidate: Candidate, tree: MergeTree, n_segments: NSegments) -> float:
    """Share of faces and pairs of poses with different labels."""
    number = tree.number_of(n_segments)
    member = np.eye(number)[tree.groups(number)]
    labels = np.stack([(posteriors @ member).argmax(axis=1) for posteriors in candidate.samples])
    return float((labels[:, None] != labels).mean())


def _without_scattered(
    candidates: CandidateSet, candidate: Candidate, tree: MergeTree, n_segments: NSegments
) -> MergeTree:
    """Merge tree in which no segment consists of small regions everywhere.

    Components of such a segment are merged before all others, with what surrounds them, until none is left. In poses of
    one mesh a segment needs a region of at least `MIN_SHARE` in half of the poses; in several meshes one is enough,
    because a mesh may have a part that the others lack.
    """
    least = len(candidates.geometries) / 2 if candidates.one_mesh else 1
    scattered = np.zeros(len(candidate.contacts.areas), dtype=bool)
    for _ in range(MERGING_ROUNDS):
        number = tree.number_of(n_segments)
        group, n_seen = tree.groups(number), np.zeros(number)
        for geometry, components in zip(candidates.geometries, candidate.likeliest, strict=True):
            labels, original = group[components], geometry.surface.original
            region = connected_regions(labels, geometry.adjacency)
            large = np.bincount(region, original.face_areas) >= MIN_SHARE * original.area
            n_seen[np.unique(labels[large[region]])] += 1
        lasting = n_seen >= least
        if lasting.all():
            break
        scattered |= ~lasting[group]
        tree = MergeTree.of(candidate.contacts, scattered)
    return tree
