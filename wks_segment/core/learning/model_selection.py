"""A mixture over several poses, and which of its components make a segment."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from ..mesh.adjacency import connected_regions
from ..mesh.triangle_mesh import FloatArray, IntArray
from ..poses.pose_signature import PoseSignature
from ..poses.signature_cache import Cache
from .candidates import Layout, layout_key
from .gaussian_mixture import CovarianceType, GaussianMixture, TooFewSamplesError, fit_mixtures
from .merge_tree import Ground, Grouping

AUTO: tuple[CovarianceType, ...] = ("shared", "diag")
"""Covariances that `covariance_type="auto"` tries on several poses; of one alone it takes the first."""
CANDIDATES = 4
"""Mixtures of each covariance whose groups are compared."""
EARNED = 0.8
"""Another covariance than the first is taken if its labels disagree less than this share as much between the poses."""
REGROUPED = 5
"""Rounds of joining at most, until no segment is lost as crumbs."""
COMPONENTS, PER_SEGMENT, MOST_MORE = 24, 3, 64
"""Components of the mixture: at least so many, and so many for each segment, but at most so many more than segments."""
MIN_SHARE = 0.005
"""Smallest part, as a share of the area."""


@dataclass(frozen=True)
class Candidates:
    """Mixtures that may do, on the poses that they were learned from.

    Attributes
    ----------
    layout : Layout
    number
        Of segments, given a grouping.
    """

    layout: Layout
    number: Callable[[Grouping], int]

    @threadpool_limits.wrap(limits=1, user_api="blas")  # on arrays this small, threads wait for each other
    def best(self) -> tuple[GaussianMixture, Grouping]:
        """A mixture, and its grouping.

        On poses of one mesh the mixture whose labels agree best between the poses; on several meshes the one whose
        regions are most like the parts that people would cut each into; on one alone the one that is surest.
        """
        layout = self.layout
        groupings = [Grouping.of(mean) for mean in layout.contacts]
        if len(layout.grounds) > 1 and layout.samples is None:
            # Compared is what comes out: bodies differ more in what is crumbs than poses do.
            groupings = [self._without_scattered(i, grouping) for i, grouping in enumerate(groupings)]
            losses = [
                self._unlike_parts(grouping, layout.grounds, of_faces)
                for grouping, of_faces in zip(groupings, layout.likeliest, strict=True)
            ]
            best = int(np.argmin(losses))
            return layout.mixtures[best], groupings[best]
        if layout.samples is None:
            losses = [-float(grouping.certainties[self.number(grouping) - 1]) for grouping in groupings]
        else:
            # What has more to fit must earn it.
            first_type = layout.mixtures[0].covariance_type
            losses = [
                self._disagreement(grouping, kept) / (1 if mixture.covariance_type == first_type else EARNED)
                for grouping, kept, mixture in zip(groupings, layout.samples, layout.mixtures, strict=True)
            ]
        best = int(np.argmin(losses))
        return layout.mixtures[best], self._without_scattered(best, groupings[best])

    def _unlike_parts(self, grouping: Grouping, grounds: Sequence[Ground], components: Sequence[IntArray]) -> float:
        """How unlike the parts of the poses the regions are, given the likeliest component of each face in each."""
        group = grouping.groups(grouping.number_of_wholes(self.number(grouping)))
        poses = zip(grounds, components, strict=True)
        return float(np.mean([ground.unlike_parts(group[of_faces]) for ground, of_faces in poses]))

    def _disagreement(self, grouping: Grouping, posteriors: Sequence[FloatArray]) -> float:
        """Share of faces and pairs of poses with different labels, given posteriors of some faces in each pose."""
        number = self.number(grouping)
        labels = np.stack([(each @ np.eye(number)[grouping.groups(number)]).argmax(axis=1) for each in posteriors])
        return float((labels[:, None] != labels).mean())

    def _without_scattered(self, index: int, grouping: Grouping) -> Grouping:
        """Joined anew until no segment is crumbs everywhere: first what is, to what it lies on.

        Of the mixture with that index. On poses of one mesh a segment must be whole in half of them; of several meshes
        one may have a part that no other has.
        """
        layout = self.layout
        contacts, components = layout.contacts[index], layout.likeliest[index]
        least = 1 if layout.samples is None else len(layout.grounds) / 2
        scattered = np.zeros(len(contacts.areas), dtype=bool)
        for _ in range(REGROUPED):
            number = self.number(grouping)
            group, seen = grouping.groups(number), np.zeros(number)
            for ground, of_faces in zip(layout.grounds, components, strict=True):
                labels, original = group[of_faces], ground.surface.original
                region = connected_regions(labels, ground.adjacency)
                large = np.bincount(region, original.face_areas) >= MIN_SHARE * original.area
                seen[np.unique(labels[large[region]])] += 1
            lasting = seen >= least
            if lasting.all():
                break
            scattered |= ~lasting[group]
            grouping = Grouping.of(contacts, scattered)
        return grouping


@dataclass(frozen=True)
class Plan:
    """Which mixtures are fitted to poses: those of more components than the segments that are wanted, to be joined.

    Attributes
    ----------
    poses
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

    poses: Sequence[PoseSignature]
    samples: FloatArray
    shares: FloatArray
    wanted: int
    covariance_types: Sequence[CovarianceType]
    open_number: bool

    def laid_out(
        self,
        standardized: Callable[[FloatArray], FloatArray],
        settings: Sequence[Any],
        cache: Cache | None,
        mixing: Callable[[float], None],
        grouping: Callable[[float], None],
    ) -> Layout:
        """The mixtures, on the poses; from the cache, if they are there for any number that has as many components.

        Parameters
        ----------
        standardized
            See `Layout.of`.
        settings
            What it depends on.
        cache
            Asked first, and told in the end.
        mixing, grouping
            Called with the share of each of both steps that is done.
        """
        key = ""
        if cache is not None:
            counts = [self._n_components(each) for each in self.covariance_types]
            key = layout_key(self.poses, [*settings, *zip(self.covariance_types, counts, strict=True)])
            kept = cache.arrays(key)
            try:
                return Layout.of_arrays(self.poses, kept or {})
            except (KeyError, ValueError):  # there is none, or it is none
                mixing(0.0)
        mixtures = self._mixtures(mixing)
        with threadpool_limits(1, "blas"):  # on arrays this small, threads wait for each other
            layout = Layout.of(self.poses, mixtures, standardized, grouping)
        # With fewer components than meant, these depend on the number of segments.
        if cache is not None and all(
            len(mixture.weights) == self._n_components(mixture.covariance_type) for mixture in mixtures
        ):
            try:
                cache.keep(key, layout.arrays())
            except OSError as error:
                warnings.warn(f"mixtures were not kept for the next time: {error}", stacklevel=2)
        return layout

    def _n_components(self, covariance_type: CovarianceType) -> int:
        if covariance_type in ("tied", "full"):
            return max(self.wanted, COMPONENTS // PER_SEGMENT) if self.open_number else self.wanted
        return min(max(COMPONENTS, PER_SEGMENT * self.wanted), self.wanted + MOST_MORE, len(self.samples))

    def _mixtures(self, tick: Callable[[float], None]) -> list[GaussianMixture]:
        found = []
        for i, each in enumerate(self.covariance_types):

            def part(share: float, begun: int = i) -> None:
                tick((begun + share) / len(self.covariance_types))

            count = self._n_components(each)
            try:
                found += fit_mixtures(self.samples, self.shares, count, each, None, CANDIDATES, part)
            except TooFewSamplesError as error:
                # A cube has three different vertices at most: no more components than that.
                count = max(self.wanted, error.distinct)
                found += fit_mixtures(self.samples, self.shares, count, each, None, CANDIDATES, part)
        return found
