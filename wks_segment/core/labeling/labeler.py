"""A learned mixture at work on poses: posteriors, clean labels, connected regions, left and right.

What is found out is kept with the poses (`Workpiece.memo`), by what it was made from: another number of segments, or
another smoothness, makes anew only what depends on it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from threadpoolctl import threadpool_limits

from ..geometry.graph_cut import REGION_CREASE, REGION_WIDTH
from ..learning.candidates import of_one_mesh
from ..learning.gaussian_mixture import GaussianMixture
from ..learning.merge_tree import Grouping
from ..learning.model_selection import MIN_SHARE
from ..mesh.adjacency import FaceAdjacency
from ..mesh.triangle_mesh import FloatArray, IntArray, TriangleMesh
from ..poses.pose_cache import Workpiece
from .polygons import PosedMesh
from .region_atlas import FIELDS, RegionAtlas, Regions, Traits, mean_traits, side_field, sides_of_parts

CLEANED = 0.7
"""Share of the time that finding regions takes, the rest is telling which is which."""
STRAY = 0.15
"""A connected part of a segment under this share of its largest one is a crumb, too: a band between two others where
the signature passes by a third one's, as head between back and tail."""
VOTERS = 5
"""Poses of a mesh that say which of its parts are left and right; more would not say it more surely."""
MOST_NUMBERS = 3_000_000
"""Posteriors of components at vertices that are kept at most; above that only those of segments are computed."""


@dataclass(frozen=True)
class Labeler:
    """A learned mixture, how its components make segments, and how smooth these are to be.

    Attributes
    ----------
    mixture : GaussianMixture
        With K components.
    grouping : Grouping or None
        None: each component is a segment.
    standardized
        From the signature of a pose to what entered the mixture.
    n_segments : int
    length : float
        Smoothing length in units of the square root of the area; 0: none.
    """

    mixture: GaussianMixture
    grouping: Grouping | None
    standardized: Callable[[FloatArray], FloatArray]
    n_segments: int
    length: float

    def posteriors(self, work: Workpiece) -> FloatArray:
        """(n', K) posteriors of the components at the vertices of a pose."""
        return self.mixture.posteriors(self.standardized(work.pose.signature))

    def joined(self, posteriors: FloatArray, n_groups: int | None = None) -> FloatArray:
        """(…, n_groups) sums of (…, K) posteriors over each group's components; over each segment's if not given."""
        if self.grouping is None:
            return posteriors
        n_groups = n_groups or self.n_segments
        return np.asarray(posteriors @ np.eye(n_groups, dtype=posteriors.dtype)[self.grouping.groups(n_groups)])

    def smoothed(self, work: Workpiece, n_groups: int | None) -> FloatArray:
        """(n', n_groups) smoothed posteriors of groups at the vertices of a pose; of components if None.

        Those of components are kept: they are the same for every number of groups.
        """

        def smooth(posteriors: FloatArray) -> FloatArray:
            return work.flows.over(self.length).smooth(posteriors) if self.length > 0 else posteriors

        if not self._keeps(len(work.pose.signature)):
            return smooth(self.joined(self.posteriors(work), n_groups))
        raw = work.memo.get("posteriors", (self.mixture,), lambda: self.posteriors(work))
        of_components = work.memo.get("smoothed", (self.mixture, self.length), lambda: smooth(raw))
        return of_components if n_groups is None else self.joined(of_components, n_groups)

    def _keeps(self, count: int) -> bool:
        """Whether posteriors of components at so many places are kept."""
        return count * len(self.mixture.weights) <= MOST_NUMBERS

    @threadpool_limits.wrap(limits=1, user_api="blas")  # on arrays this small, threads wait for each other
    def clean(
        self,
        works: Sequence[Workpiece],
        polygons: Sequence[IntArray] | None,
        least_share: float,
        progress: Callable[[float], None] | None = None,
        marked: IntArray | None = None,
        n_groups: int | None = None,
    ) -> tuple[IntArray, FaceAdjacency]:
        """Segments, or with `n_groups` what regions are parts of; of polygons (None: triangles). See `PosedMesh`."""
        # What poses of one mesh have in common is kept with the first.
        kind, memo = ("faces" if polygons is None else "polygons", len(works)), works[0].memo
        posed = memo.get(
            ("posed", *kind), (*(work.pose for work in works), *(polygons or ())), lambda: PosedMesh(works, polygons)
        )
        joined = n_groups or self.n_segments
        if self._keeps(max(posed.n_polygons, *(len(work.pose.signature) for work in works))):
            of_components = memo.get(
                ("mean", *kind),
                (posed, self.mixture, self.length),
                lambda: posed.mean(works, lambda work: self.smoothed(work, None), progress),
            )
            posteriors = self.joined(of_components, joined)
        else:
            posteriors = posed.mean(works, lambda work: self.smoothed(work, joined), progress)
        if n_groups is None:
            how = {"least_of_largest": STRAY if least_share > 0 else 0.0}
        else:
            how = {"crease": REGION_CREASE, "width": REGION_WIDTH}
        return posed.labeled(works, posteriors, self.length, least_share, marked, **how)

    @threadpool_limits.wrap(limits=1, user_api="blas")  # as above
    def named_regions(self, atlas: RegionAtlas, work: Workpiece, least_share: float) -> IntArray:
        """(m,) region of each face, numbered as in the atlas, and on from there."""
        regions = self._regions(atlas.n_groups, [work], least_share)
        return regions.numbered(atlas.named(self._traits(regions, work, 1)), len(atlas.side))

    @threadpool_limits.wrap(limits=1, user_api="blas")  # as above
    def atlas(
        self, n_groups: int, works: Sequence[Workpiece], rest: TriangleMesh | None, tick: Callable[[float], None]
    ) -> RegionAtlas:
        """The connected regions of so many groups on learned poses, and which are left and right.

        ValueError if `rest` has other faces than the first pose.
        """
        first = works[0].surface.original
        if rest is not None and not np.array_equal(rest.faces, first.faces):
            raise ValueError("rest has other faces than the first pose: pass the same mesh, in its rest position")
        found: list[Regions] = []
        traits: list[Traits] = []
        for alike in _together(works):

            def cleaning(share: float, begun: int = len(traits), count: int = len(alike)) -> None:
                tick((begun + CLEANED * share * count) / len(works))

            regions = self._regions(n_groups, alike, self.least_share, cleaning)
            found.append(regions)
            begun = len(traits)
            for i, work in enumerate(alike):
                tick((begun + CLEANED * len(alike) + (1 - CLEANED) * i) / len(works))
                traits.append(self._traits(regions, work, len(alike)))
        centers = found[0].centers(first if rest is None else rest)
        return RegionAtlas.learned(n_groups, traits, centers, alike=len(found) == 1)

    @threadpool_limits.wrap(limits=1, user_api="blas")  # as above
    def sides(
        self,
        atlas: RegionAtlas,
        works: Sequence[Workpiece],
        polygons: Sequence[IntArray],
        labels: IntArray,
        progress: Callable[[float], None] | None = None,
    ) -> IntArray:
        """(p,) side of each polygon, given the segments: see `PoseSegmentation.polygon_sides`."""
        voters = sorted(set(np.linspace(0, len(works) - 1, VOTERS).round().astype(int).tolist()))
        given: list[IntArray] = []

        def tick(done: float) -> None:
            if progress:
                progress(done / len(voters))

        for alike in _together([works[i] for i in voters]):
            begun = len(given)

            def cleaning(share: float, begun: int = begun, count: int = len(alike)) -> None:
                tick(begun + CLEANED * share * count)

            regions = self._regions(atlas.n_groups, alike, self.least_share, cleaning)
            names = atlas.named(mean_traits([self._traits(regions, work, len(alike)) for work in alike]))
            of_faces = atlas.sides_of(regions.numbered(names, len(atlas.side)))
            for i, work in enumerate(alike):
                polygon_of = polygons[voters[len(given)]]
                field = _kept_side_field(work, regions, atlas, of_faces)
                given.append(_sides_seen_in(work, field, polygon_of, labels))
                tick(begun + CLEANED * len(alike) + (1 - CLEANED) * (i + 1))
        # Half left and half neither is neither.
        return np.trunc(np.median(given, axis=0)).astype(np.int64)

    @property
    def least_share(self) -> float:
        """Smallest part where nothing is said of it, as a share of the area."""
        return MIN_SHARE if self.length > 0 else 0.0

    def _regions(
        self,
        n_groups: int,
        works: Sequence[Workpiece],
        least_share: float,
        progress: Callable[[float], None] | None = None,
    ) -> Regions:
        """Connected regions of so many groups on a mesh, agreed on by poses of it."""

        def found() -> Regions:
            labels, neighbors = self.clean(works, None, least_share, progress, n_groups=n_groups)
            return Regions.of(labels, neighbors, works[0].surface.original)

        poses = (work.pose for work in works)
        made_from = self.mixture, self.grouping, n_groups, self.length, least_share, *poses
        return works[0].memo.get(("regions", len(works)), made_from, found)

    def _traits(self, regions: Regions, work: Workpiece, n_poses: int) -> Traits:
        """What tells regions, found in so many poses together, apart in one of them."""
        fields = work.memo.get("fields", (self.mixture,), lambda: self._fields(work))
        return work.memo.get(("traits", n_poses), (regions, fields), lambda: regions.traits(work, fields))

    def _fields(self, work: Workpiece) -> FloatArray:
        """(n', FIELDS) the signature along the axes on which the components lie farthest apart."""
        means, weights = self.mixture.means, self.mixture.weights
        axes = np.linalg.eigh((means * weights[:, None]).T @ means)[1][:, ::-1][:, :FIELDS]
        # Which way an axis points is up to the library; a model must mean the same everywhere.
        axes *= np.sign(axes[np.abs(axes).argmax(axis=0), np.arange(axes.shape[1])])
        fields = self.standardized(work.pose.signature) @ axes
        return np.pad(fields, ((0, 0), (0, FIELDS - axes.shape[1])))


def _together(works: Sequence[Workpiece]) -> list[Sequence[Workpiece]]:
    """The poses whose regions are the same ones: all that have the same faces, or each alone."""
    return [works] if of_one_mesh([work.pose for work in works]) else [[work] for work in works]


def _kept_side_field(work: Workpiece, regions: Regions, atlas: RegionAtlas, side: IntArray) -> FloatArray:
    """(m,) how far left or right each face of a pose is, given the side of each face's region."""
    return work.memo.get("sides", (regions, atlas), lambda: side_field(work, side))


def _sides_seen_in(work: Workpiece, field: FloatArray, polygon_of: IntArray, labels: IntArray) -> IntArray:
    """(p,) side of each polygon as one pose has it."""
    neighbors = work.memo.get("polygons", (polygon_of,), lambda: work.neighbors.between_polygons(polygon_of))
    return sides_of_parts(work.surface, field, polygon_of, labels, MIN_SHARE, neighbors)
