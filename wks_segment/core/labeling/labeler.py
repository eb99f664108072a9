"""Labels a pose with a fitted model: posteriors, clean labels, connected regions, left and right.

Intermediate results are kept with the poses (`Workpiece.results`) together with their inputs: another number of
segments, or another smoothness, computes only the results that depend on it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from ..geometry.graph_cut import REGION_CREASE, REGION_WIDTH, CutStyle
from ..learning.body_plan import BodyPlan
from ..learning.gaussian_mixture import GaussianMixture
from ..learning.merge_tree import MergeTree
from ..learning.standardizer import Standardizer
from ..learning.taught_parts import TaughtParts
from ..mesh.adjacency import FaceAdjacency
from ..mesh.triangle_mesh import FloatArray, IntArray, TriangleMesh
from ..poses.pose_cache import Kind, ResultKey, Workpiece, smooth_means
from ..poses.pose_signature import of_one_mesh
from ..progress import Progress
from .learned_areas import with_learned_areas
from .own_parts import OwnParts, own_parts
from .planned_parts import with_plan
from .polygons import AVERAGED, Cleaning, PolygonMesh
from .pose_steps import pose_signatures, spread_over, steps_of
from .region_atlas import RegionAtlas
from .sides import have_counterpart, side_field, sides_in_pose
from .taught_sides import halves
from .traits import Regions, Traits, fields_of, mean_traits

LABELS_SHARE = 0.7
"""Share of the time of finding regions that their labels take; the rest is recognizing the regions."""
MIN_SHARE = 0.005
"""Default share of the area that a connected region must have to keep its label."""
SMALLEST_OF_TAUGHT = 0.15
"""With taught parts that are small, at most this share of the smallest one: it may lie in several regions."""
STRAY_SHARE = 0.15
"""A connected region with less than this share of the area of the largest one of its segment is too small as well. Such
regions are bands between two other segments where the signature passes through the values of a third, such as a band of
"head" between back and tail."""
VOTERS = 5
"""Number of poses of a mesh that vote on its sides; more poses hardly change the result."""
MOST_LEARNED = 3
"""Number of poses of a mesh whose traits are learned."""
MOST_POSTERIORS = 3_000_000
"""Maximum number of posteriors of kinds that are kept with a pose; above it, only those of segments are computed, to
save memory."""


@dataclass(frozen=True)
class Labeler:
    """A fitted model with its current settings, which labels poses.

    Attributes
    ----------
    mixture : GaussianMixture
        With K components.
    standardizer : Standardizer
        From the signature of a pose to the space of the mixture.
    grouping : MergeTree or None
        None: each component is a segment.
    n_segments : int
    length : float
        Smoothing length in units of the square root of the area; 0: no smoothing.
    of_bodies : bool
        Whether the kinds are those of several meshes: a mesh is then cut by its own shape.
    taught : TaughtParts or None
        Which of the first segments are taught parts, or two of them, which differ by their side.
    sides_atlas : RegionAtlas or None
        Tells these sides.
    plan : BodyPlan or None
        Where taught parts lie in the plan of a body, if that is known.
    """

    mixture: GaussianMixture
    standardizer: Standardizer
    grouping: MergeTree | None
    n_segments: int
    length: float
    of_bodies: bool = False
    taught: TaughtParts | None = None
    sides_atlas: RegionAtlas | None = None
    plan: BodyPlan | None = None

    @property
    def n_kept(self) -> int:
        """Number of groups whose posteriors are kept with a pose: the kinds of parts, or the segments if more."""
        if self.grouping is None:
            return len(self.mixture.weights)
        return max(self.grouping.n_kinds, self.n_segments)

    @property
    def min_share(self) -> float:
        """Default of the smallest share of the area that a region must have."""
        if self.length == 0:
            return 0.0
        if self.taught is None or self.grouping is None or self.grouping.areas is None:
            return MIN_SHARE
        of_groups = np.bincount(self.grouping.groups(self.n_segments), self.grouping.areas)
        return float(min(MIN_SHARE, SMALLEST_OF_TAUGHT * of_groups[: self.taught.n_groups].min()))

    def posteriors(self, pose: Workpiece) -> FloatArray:
        """(n', n_segments) posteriors of the segments at the vertices of the surface of a pose."""
        return self._merged(self._raw(pose, self.n_kept), self.n_segments)

    def of_parts(self, pose: Workpiece, posteriors: FloatArray) -> FloatArray:
        """(n', parts) posteriors at the vertices of a pose, with the taught left and right parts as two."""
        if self.taught is None:
            return posteriors
        if len(self.taught.sided) and self.sides_atlas is not None:
            (_, field), *_ = self._fields_of_sides(self.sides_atlas, [pose], Progress())
            return self.taught.of_parts(posteriors, pose.surface.from_faces(field[:, None])[:, 0])
        return self.taught.of_parts(posteriors, np.ones(len(posteriors)))

    def smoothed(self, pose: Workpiece, n_groups: int) -> FloatArray:
        """(n', n_groups) smoothed posteriors of groups at the vertices of a pose."""
        return self._smooth([pose], n_groups)(pose)

    def segments(
        self,
        poses: Sequence[Workpiece],
        polygons: Sequence[IntArray] | None,
        min_share: float,
        progress: Progress,
        marked: IntArray | None = None,
    ) -> tuple[IntArray, FaceAdjacency]:
        """Clean segments of the polygons of a mesh, and the neighbors among polygons; see `PolygonMesh.labels`.

        With `polygons` None, each triangle is a polygon.
        """
        mesh = self._polygon_mesh(poses, polygons)
        step = progress.part(0.0, AVERAGED)
        posteriors = self._mean_posteriors(mesh, poses, polygons is not None, self.n_segments, step)
        cleaning = Cleaning(CutStyle(self.length), min_share, STRAY_SHARE if min_share > 0 else 0.0)
        labels, neighbors = mesh.labels(poses, posteriors, cleaning, marked)
        if self.taught is None:
            return labels, neighbors
        sides = np.ones(len(labels), dtype=np.int64)
        if len(self.taught.sided) and self.sides_atlas is not None:
            votes = [
                halves(mesh.of_faces(field, i), labels, neighbors, mesh.areas)
                for i, field in self._fields_of_sides(self.sides_atlas, poses, progress.part(AVERAGED, 1.0))
            ]
            sides = np.where(np.mean(votes, axis=0) < 0, -1, 1)
        return self.taught.parts(labels, sides), neighbors

    def numbered_regions(self, atlas: RegionAtlas, pose: Workpiece, min_share: float) -> IntArray:
        """(m,) region of each face, numbered as in the atlas; regions that were not learned have higher numbers."""
        regions = self._regions(atlas.n_groups, [pose], min_share, Progress())
        return regions.numbered(atlas.numbers_of(self._traits(regions, pose, 1)), len(atlas.side))

    def atlases(
        self,
        poses: Sequence[Workpiece],
        rest: TriangleMesh | None,
        progress: Progress,
        known: Sequence[RegionAtlas] = (),
    ) -> tuple[RegionAtlas, RegionAtlas]:
        """Atlas of the connected regions of wholes, and atlas of those of segments, of the learned poses.

        A whole may lie on both sides, as forelegs together with the chest between them; so left and right are told by
        segments. If these are the wholes, both atlases are the same.

        Parameters
        ----------
        poses
            The learned poses.
        rest : TriangleMesh or None
            See `PoseSegmentation.fit`.
        progress : Progress
        known
            Atlases that were learned already.

        Raises
        ------
        ValueError
            If `rest` has other faces than the first pose.
        """
        grouping = self.grouping
        assert grouping is not None
        # Own parts of a body are whole as they are: what they have in common is for segments only.
        n_wholes = grouping.n_kinds if self.of_bodies else grouping.number_of_wholes(self.n_segments)
        numbers = n_wholes, self.n_segments
        atlases = {atlas.n_groups: atlas for atlas in known}
        for n_groups, step in progress.each(sorted(set(numbers) - atlases.keys())):
            atlases[n_groups] = self._atlas(n_groups, poses, rest, step)
        wholes, segments = (atlases[n_groups] for n_groups in numbers)
        return wholes, segments

    def sides(
        self,
        atlas: RegionAtlas,
        poses: Sequence[Workpiece],
        polygons: Sequence[IntArray],
        labels: IntArray,
        progress: Progress,
    ) -> IntArray:
        """(p,) side of each polygon, given the segments; see `PoseSegmentation.polygon_sides`."""
        votes = [
            sides_in_pose(poses[i], field, polygons[i], labels, MIN_SHARE)
            for i, field in self._fields_of_sides(atlas, poses, progress)
        ]
        # A tie between left and neither is neither.
        return np.trunc(np.median(votes, axis=0)).astype(np.int64)

    def _fields_of_sides(
        self, atlas: RegionAtlas, poses: Sequence[Workpiece], progress: Progress
    ) -> Iterator[tuple[int, FloatArray]]:
        """Index of each pose that votes on sides, and the (m,) side field on its faces."""
        voters = spread_over(poses, VOTERS)
        done = 0
        for together, step in steps_of([poses[i] for i in voters], progress):
            regions = self._regions(atlas.n_groups, together, self.min_share, step.part(0.0, LABELS_SHARE))
            found = mean_traits([self._traits(regions, pose, len(together)) for pose in together])
            numbers = atlas.numbers_of(found)
            side = atlas.sides_of(numbers)
            if self.taught is not None:
                # Thighs can be one region in one pose and two in another, of which one would be matched with a crumb.
                side = np.where(have_counterpart(found.area, side, found.segment), side, 0)
            side_of_face = np.append(side, 0)[np.minimum(regions.region, len(side))]
            for pose, _ in step.part(LABELS_SHARE, 1.0).each(together):
                key, field = ResultKey(Kind.SIDE_FIELD), partial(side_field, pose, side_of_face)
                yield voters[done], pose.results.get(key, (regions, atlas), field)
                done += 1

    def _atlas(
        self, n_groups: int, poses: Sequence[Workpiece], rest: TriangleMesh | None, progress: Progress
    ) -> RegionAtlas:
        first = poses[0].surface.original
        if rest is not None and not np.array_equal(rest.faces, first.faces):
            raise ValueError("rest has other faces than the first pose: pass the same mesh, in its rest position")
        regions, traits = self.regions_of(n_groups, poses, progress, MOST_LEARNED)
        centers = regions[0].centers(first if rest is None else rest)
        return RegionAtlas.learned(n_groups, traits, centers, alike=all(one is regions[0] for one in regions))

    def regions_of(
        self, n_groups: int, poses: Sequence[Workpiece], progress: Progress, most: int | None = None
    ) -> tuple[list[Regions], list[Traits]]:
        """Connected regions of groups on each pose, and their traits; poses of one mesh share the object.

        With `most`, of at most so many poses of one mesh.
        """
        of_poses: list[Regions] = []
        traits: list[Traits] = []
        for together, step in steps_of(poses, progress):
            regions = self._regions(n_groups, together, self.min_share, step.part(0.0, LABELS_SHARE))
            measured = together if most is None else [together[i] for i in spread_over(together, most)]
            for pose, _ in step.part(LABELS_SHARE, 1.0).each(measured):
                of_poses.append(regions)
                traits.append(self._traits(regions, pose, len(together)))
        return of_poses, traits

    def _regions(self, n_groups: int, poses: Sequence[Workpiece], min_share: float, progress: Progress) -> Regions:
        """Connected regions of groups on a mesh, found in several poses of it together."""

        def compute() -> Regions:
            mesh = self._polygon_mesh(poses, None)
            cleaning = Cleaning(CutStyle(self.length, REGION_CREASE, REGION_WIDTH), min_share)
            if not self.of_bodies or self.grouping is None or self.length == 0:
                posteriors, group = self._mean_posteriors(mesh, poses, False, n_groups, progress), np.arange(n_groups)
            else:
                own = self._own_parts(poses, progress)
                whole, group = own.wholes(self.grouping.group_of_groups(self.grouping.n_kinds, n_groups))
                posteriors = np.eye(len(group))[whole][own.part]
            labels, neighbors = mesh.labels(poses, posteriors, cleaning)
            return Regions.of(labels, neighbors, poses[0].surface.original, group)

        inputs = self.mixture, self.grouping, self.plan, n_groups, self.length, min_share, *pose_signatures(poses)
        return poses[0].results.get(ResultKey(Kind.REGIONS, len(poses)), inputs, compute)

    def _polygon_mesh(self, poses: Sequence[Workpiece], polygons: Sequence[IntArray] | None) -> PolygonMesh:
        # Results about all poses of a mesh are kept with the first one.
        key = ResultKey(Kind.POLYGON_MESH, len(poses), polygons is not None)
        inputs = (*pose_signatures(poses), *(polygons or ()))
        return poses[0].results.get(key, inputs, lambda: PolygonMesh(poses, polygons))

    def _mean_posteriors(
        self, mesh: PolygonMesh, poses: Sequence[Workpiece], of_polygons: bool, n_groups: int, progress: Progress
    ) -> FloatArray:
        """(p, n_groups) smoothed posteriors of polygons, mean over the poses, with the areas that were learned."""
        progress = progress.never_falling()
        if not self._keeps(max(mesh.n_polygons, *(len(pose.signature) for pose in poses))):
            found = self._symmetric(mesh, mesh.mean(poses, self._on_faces(poses, n_groups, progress), progress))
            return self._with_learned_areas(mesh, found)
        of_kinds = poses[0].results.get(
            ResultKey(Kind.MEAN_POSTERIORS, len(poses), of_polygons),
            (mesh, self.mixture, self.grouping, self.plan, self.n_kept, self.length),
            lambda: self._symmetric(mesh, mesh.mean(poses, self._on_faces(poses, self.n_kept, progress), progress)),
        )
        return self._with_learned_areas(mesh, self._merged(of_kinds, n_groups))

    def _with_learned_areas(self, mesh: PolygonMesh, posteriors: FloatArray) -> FloatArray:
        """(p, n_groups) posteriors of polygons with the areas that were learned, where they count.

        So they do for parts of one mesh that nobody named, and for parts taught on several bodies, not on one.
        """
        grouping = self.grouping
        do_not_count = self.of_bodies if self.taught is None else not self.taught.of_bodies
        if grouping is None or grouping.areas is None or do_not_count or self.length == 0:
            return posteriors
        n_groups = posteriors.shape[1]
        shares = np.bincount(grouping.groups(n_groups), grouping.areas, n_groups).astype(np.float64)
        return with_learned_areas(posteriors, mesh.sound_areas, shares)

    def _symmetric(self, mesh: PolygonMesh, posteriors: FloatArray) -> FloatArray:
        """Posteriors of polygons, the same on both sides of a symmetric mesh; as they are without smoothing."""
        return mesh.mirrored(posteriors) if self.length > 0 else posteriors

    def _on_faces(
        self, poses: Sequence[Workpiece], n_groups: int, progress: Progress
    ) -> Callable[[Workpiece], FloatArray]:
        """Function that gives the (m, n_groups) posteriors on the faces of one of the poses of a mesh."""
        if not self.of_bodies or self.length == 0:
            smooth = self._smooth(poses, n_groups)
            return lambda pose: pose.surface.to_faces(smooth(pose))
        together = poses if of_one_mesh(pose_signatures(poses)) else None

        def on_faces(pose: Workpiece) -> FloatArray:
            own = self._own_parts(together or [pose], progress)
            return self._merged(own.posteriors, n_groups)[own.region]

        return on_faces

    def _smooth(self, poses: Sequence[Workpiece], n_groups: int) -> Callable[[Workpiece], FloatArray]:
        """Function that gives the (n', n_groups) smoothed posteriors of groups at the vertices of one of the poses."""
        return smooth_means(poses, lambda pose: self._kept(pose, n_groups), self.length)

    def _own_parts(self, poses: Sequence[Workpiece], progress: Progress) -> OwnParts:
        """Parts of a mesh, in some poses, that is cut by its own shape."""
        assert self.grouping is not None
        n_kinds = self.grouping.n_kinds
        group = self.grouping.groups(n_kinds)

        def log_likelihoods(pose: Workpiece) -> FloatArray:
            samples = self.standardizer.transform(pose.signature)
            return self.mixture.group_log_likelihoods(samples, group, n_kinds)

        inputs = self.mixture, self.grouping, *pose_signatures(poses)
        return poses[0].results.get(
            ResultKey(Kind.OWN_PARTS, len(poses)),
            inputs,
            lambda: own_parts(poses, log_likelihoods, n_kinds, progress),
        )

    def _keeps(self, count: int) -> bool:
        """Whether posteriors of kinds at this many places are kept."""
        return count * self.n_kept <= MOST_POSTERIORS

    def _kept(self, pose: Workpiece, n_groups: int) -> FloatArray:
        """(n', n_groups) posteriors of groups at the vertices of a pose, from those of kinds that are kept with it."""
        if not self._keeps(len(pose.signature)):
            return self._raw(pose, n_groups)
        of_kinds = pose.results.get(
            ResultKey(Kind.POSTERIORS),
            (self.mixture, self.grouping, self.plan, self.n_kept),
            lambda: self._raw(pose, self.n_kept),
        )
        return self._merged(of_kinds, n_groups)

    def _raw(self, pose: Workpiece, n_groups: int) -> FloatArray:
        """(n', n_groups) posteriors of groups of components at the vertices of a pose."""
        samples = self.standardizer.transform(pose.signature)
        if self.grouping is None:
            return self.mixture.posteriors(samples)
        posteriors = self.mixture.group_posteriors(samples, self.grouping.groups(n_groups), n_groups)
        if self.plan is None or n_groups != len(self.plan.shares):
            return posteriors
        return with_plan(posteriors, pose, self.plan)

    def _merged(self, posteriors: FloatArray, n_groups: int) -> FloatArray:
        """(…, n_groups) sums of posteriors of finer groups over those of each group."""
        fine = posteriors.shape[-1]
        if self.grouping is None or fine == n_groups:
            return posteriors
        owner = self.grouping.group_of_groups(fine, n_groups)
        return np.asarray(posteriors @ np.eye(n_groups, dtype=posteriors.dtype)[owner])

    def _traits(self, regions: Regions, pose: Workpiece, n_poses: int) -> Traits:
        """Traits, in one pose, of regions that were found in `n_poses` poses together."""
        means, weights = self.mixture.means, self.mixture.weights
        fields = pose.results.get(
            ResultKey(Kind.FIELDS),
            (self.mixture,),
            lambda: fields_of(means, weights, self.standardizer.transform(pose.signature)),
        )
        key = ResultKey(Kind.TRAITS, n_poses)
        return pose.results.get(key, (regions, fields), lambda: regions.traits(pose, fields))
