"""A mixture over several poses, and which of its components make a segment."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from threadpoolctl import threadpool_limits

from .grouping import Contacts, Ground, Grouping
from .mesh import FloatArray, IntArray
from .mixture import CovarianceType, GaussianMixture, TooFewSamplesError, drawn_evenly, fit_mixtures
from .pose_signature import PoseSignature
from .regions import connected_regions
from .smoothing import HeatFlow

AUTO: tuple[CovarianceType, ...] = ("shared", "diag")
"""Covariances that `covariance_type="auto"` tries on several poses; of one alone it takes the first."""
CANDIDATES = 4
"""Mixtures of each covariance whose groups are compared."""
EARNED = 0.8
"""Another covariance than the first is taken if its labels disagree less than this share as much between the poses."""
COMPARED = 4_000
"""Faces on which the labels of the learned poses are compared."""
REGROUPED = 5
"""Rounds of joining at most, until no segment is lost as crumbs."""
LAID = 0.8
"""Share of the time of a pose when it is laid out, see `Ground`; the rest is to lay the mixtures on it."""
COMPONENTS, PER_SEGMENT, MOST_MORE = 24, 3, 64
"""Components of the mixture: at least so many, and so many for each segment, but at most so many more than segments."""
SMOOTHING_LENGTH = 0.03
"""Width of the smoothing along borders at smoothness 1, in units of the square root of the area."""
MIN_SHARE = 0.005
"""Smallest part, as a share of the area."""


@dataclass(frozen=True)
class Candidates:
    """Mixtures that may do, on the poses that they were learned from.

    Attributes
    ----------
    poses
    mixtures
        In the space of `standardised`.
    standardised
        From the signature of a pose to what enters the mixture.
    number
        Of segments, given a grouping.
    """

    poses: Sequence[PoseSignature]
    mixtures: Sequence[GaussianMixture]
    standardised: Callable[[FloatArray], FloatArray]
    number: Callable[[Grouping], int]

    @threadpool_limits.wrap(limits=1, user_api="blas")  # on arrays this small, threads wait for each other
    def best(self, tick: Callable[[float], None]) -> tuple[GaussianMixture, Grouping]:
        """A mixture, and its grouping.

        On poses of one mesh the mixture whose labels agree best between the poses; on several meshes the one whose
        regions are most like the parts that people would cut each into; on one alone the one that is surest.
        """
        contacts: list[list[Contacts]] = [[] for _ in self.mixtures]
        likeliest: list[list[IntArray]] = [[] for _ in self.mixtures]
        grounds = []
        samples: list[list[FloatArray]] = [[] for _ in self.mixtures]
        first = self.poses[0].surface.original
        drawn = drawn_evenly(first.face_areas / first.area, COMPARED) if of_one_mesh(self.poses) else None
        for i, pose in enumerate(self.poses):

            def of_pose(share: float, begun: int = i) -> None:
                tick((begun + share) / len(self.poses))

            of_pose(0.0)
            ground = Ground.of(pose.surface, lambda share, of_pose=of_pose: of_pose(LAID * share))  # type: ignore[misc]
            standardised = self.standardised(pose.signature)
            grounds.append(ground)
            flow = HeatFlow(pose.surface.mesh, SMOOTHING_LENGTH)
            for j, mixture in enumerate(self.mixtures):
                of_pose(LAID + (1 - LAID) * j / len(self.mixtures))
                of_faces = pose.surface.to_faces(flow.smooth(mixture.posteriors(standardised)))
                contacts[j].append(Contacts.on(ground, of_faces))
                likeliest[j].append(of_faces.argmax(axis=1))
                if drawn is not None:
                    samples[j].append(of_faces[drawn])
        means = [Contacts.mean(found) for found in contacts]
        if drawn is not None:
            means = [mean.with_changes(np.stack(kept)) for mean, kept in zip(means, samples, strict=True)]
        groupings = [Grouping.of(mean) for mean in means]
        if len(self.poses) == 1:
            losses = [-float(grouping.certainties[self.number(grouping) - 1]) for grouping in groupings]
        elif drawn is None:
            losses = [
                self._unlike_parts(grouping, grounds, of_faces)
                for grouping, of_faces in zip(groupings, likeliest, strict=True)
            ]
        else:
            # What has more to fit must earn it.
            first_type = self.mixtures[0].covariance_type
            losses = [
                self._disagreement(grouping, kept) / (1 if mixture.covariance_type == first_type else EARNED)
                for grouping, kept, mixture in zip(groupings, samples, self.mixtures, strict=True)
            ]
        best = int(np.argmin(losses))
        return self.mixtures[best], self._without_scattered(means[best], groupings[best], grounds, likeliest[best])

    def _unlike_parts(self, grouping: Grouping, grounds: Sequence[Ground], components: Sequence[IntArray]) -> float:
        """How unlike the parts of the poses the regions are, given the likeliest component of each face in each."""
        group = grouping.groups(grouping.number_of_wholes(self.number(grouping)))
        poses = zip(grounds, components, strict=True)
        return float(np.mean([ground.unlike_parts(group[of_faces]) for ground, of_faces in poses]))

    def _disagreement(self, grouping: Grouping, posteriors: list[FloatArray]) -> float:
        """Share of faces and pairs of poses with different labels, given posteriors of some faces in each pose."""
        number = self.number(grouping)
        labels = np.stack([(each @ np.eye(number)[grouping.groups(number)]).argmax(axis=1) for each in posteriors])
        return float((labels[:, None] != labels).mean())

    def _without_scattered(
        self, contacts: Contacts, grouping: Grouping, grounds: Sequence[Ground], components: Sequence[IntArray]
    ) -> Grouping:
        """Joined anew until no segment is crumbs everywhere: first what is, to what it lies on.

        Given the likeliest component of each face in each pose.
        """
        scattered = np.zeros(len(contacts.areas), dtype=bool)
        for _ in range(REGROUPED):
            number = self.number(grouping)
            group, seen = grouping.groups(number), np.zeros(number)
            for ground, of_faces in zip(grounds, components, strict=True):
                labels, original = group[of_faces], ground.surface.original
                region = connected_regions(labels, ground.adjacency)
                large = np.bincount(region, original.face_areas) >= MIN_SHARE * original.area
                seen[np.unique(labels[large[region]])] += 1
            lasting = seen >= len(grounds) / 2
            if lasting.all():
                break
            scattered |= ~lasting[group]
            grouping = Grouping.of(contacts, scattered)
        return grouping


def fine_mixtures(
    samples: FloatArray,
    shares: FloatArray,
    wanted: int,
    covariance_types: Sequence[CovarianceType],
    open_number: bool,
    tick: Callable[[float], None],
) -> list[GaussianMixture]:
    """Mixtures of more components than the segments that are wanted, to be joined.

    Parameters
    ----------
    samples, shares
        See `fit_mixtures`.
    wanted : int
        Segments at least.
    covariance_types
        Those to try.
    open_number : bool
        Whether the number of segments is left open: "tied" and "full" then have a few components, else as many as
        segments. A finer mixture of these would take minutes, and learn every pose by heart.
    """
    found = []
    for i, each in enumerate(covariance_types):

        def part(share: float, begun: int = i) -> None:
            tick((begun + share) / len(covariance_types))

        n_components = min(max(COMPONENTS, PER_SEGMENT * wanted), wanted + MOST_MORE, len(samples))
        if each in ("tied", "full"):
            n_components = max(wanted, COMPONENTS // PER_SEGMENT) if open_number else wanted
        try:
            found += fit_mixtures(samples, shares, n_components, each, None, CANDIDATES, part)
        except TooFewSamplesError as error:
            # A cube has three different vertices at most: no more components than that.
            found += fit_mixtures(samples, shares, max(wanted, error.distinct), each, None, CANDIDATES, part)
    return found


def of_one_mesh(poses: Sequence[PoseSignature]) -> bool:
    """Whether several poses have the same faces."""
    faces = [pose.surface.original.faces for pose in poses]
    return len(poses) > 1 and all(np.array_equal(faces[0], other) for other in faces[1:])
