"""Methods of a model that label poses; see `PoseSegmentation`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np

from ..learning.body_plan import BodyPlan
from ..learning.gaussian_mixture import GaussianMixture
from ..learning.merge_tree import MergeTree
from ..learning.part_mixture import SMOOTHING_LENGTH, PartMixture
from ..learning.standardizer import Standardizer
from ..learning.taught_parts import TaughtParts
from ..mesh.adjacency import connected_regions
from ..mesh.triangle_mesh import FloatArray, IntArray
from ..message import Message
from ..poses.arguments import as_list
from ..poses.describe import PoseDescriber
from ..poses.pose_cache import AnyPose, Workpiece
from ..progress import Progress, ShareFunction
from ..threads import one_blas_thread
from .labeler import Labeler
from .region_atlas import RegionAtlas

TAUGHT_LENGTH = 0.015
"""Width of the smoothing along borders of parts that were taught on one mesh, at smoothness 1, in units of the square
root of the area: signatures are surer of them than of others, and a neck is a narrow band that more smoothing takes
away (docs/dev/experiments.md)."""


class PoseLabeling(PoseDescriber):
    """Base of models: labels poses with what was learned and the current settings; see `PoseSegmentation`."""

    n_segments: int | Literal["auto"]
    mixture_: GaussianMixture
    standardizer_: Standardizer
    grouping_: MergeTree | None
    of_bodies_: bool
    taught_: TaughtParts | None
    plan_: BodyPlan | None
    regions_: RegionAtlas | None
    sides_: RegionAtlas | None

    def _effective(self, name: str) -> Any:
        """Value of a parameter after the preset."""
        raise NotImplementedError

    @one_blas_thread
    def predict(self, mesh: AnyPose) -> IntArray:
        """(n,) segment of each vertex: the one with the highest posterior, as in the paper."""
        return np.asarray(self.predict_proba(mesh).argmax(axis=1))

    @one_blas_thread
    def predict_proba(self, mesh: AnyPose) -> FloatArray:
        """(n, n_segments) posterior of each segment at each vertex; rows sum to 1."""
        labeler, pose = self._labeler(), self._described(mesh)
        return pose.surface.to_vertices(labeler.of_parts(pose, labeler.posteriors(pose)))

    @one_blas_thread
    def predict_soft(self, mesh: AnyPose) -> FloatArray:
        """(n, n_segments) posteriors of `predict_proba`, smoothed as much as the labels of faces."""
        labeler, pose = self._labeler(), self._described(mesh)
        posteriors = labeler.smoothed(pose, labeler.n_segments)
        if labeler.length > 0:
            # Obtuse triangles let the heat flow a little beyond 0 and 1.
            posteriors = np.clip(posteriors, 0, 1).astype(np.float64)
            posteriors /= posteriors.sum(axis=1, keepdims=True)
        return pose.surface.to_vertices(labeler.of_parts(pose, posteriors))

    @one_blas_thread
    def segment_faces(self, mesh: AnyPose, min_share: float | None = None) -> IntArray:
        """(m,) segment of each face, with smooth borders and no region smaller than `min_share` of the area.

        `min_share` is 0.005 if not given, and 0 without smoothing. Unless it is 0, no region is smaller than 15 % of
        the largest one of its segment either. An island that is smaller as a whole takes the label of its surroundings.
        With a model of several meshes, and smoothing, the mesh is cut into regions by its own shape, and each region
        has one segment before borders are smoothed. Faces of an exactly symmetric mesh have the label of their mirror
        images.
        """
        return self._labeler().segments([self._described(mesh)], None, self._min_share(min_share), Progress())[0]

    @one_blas_thread
    def segment_regions(self, mesh: AnyPose, min_share: float | None = None) -> IntArray:
        """(m,) connected region of each face: the left and the right hand are two.

        Region i of one pose is region i of every other pose, on any meshing: numbers are those of `regions_`; regions
        that were not learned have higher numbers, and a pose may lack some. They are connected regions of segments,
        except that segments which are most likely fragments of one part are one here: as whole as people see them. With
        the paper's setting they are the connected regions of the components, in the order of these. Regions smaller
        than `min_share` of the area belong to a neighboring region.
        """
        labeler, pose, share = self._labeler(), self._described(mesh), self._min_share(min_share)
        if self.regions_ is None:
            return connected_regions(*labeler.segments([pose], None, share, Progress()))
        return labeler.numbered_regions(self.regions_, pose, share)

    @one_blas_thread
    def segment_polygons(
        self,
        poses: Sequence[AnyPose],
        polygons: Sequence[IntArray],
        min_share: float | None = None,
        progress: ShareFunction | Progress | None = None,
        marked: IntArray | None = None,
    ) -> IntArray:
        """Label the polygons of one mesh, given in one or several poses, as `segment_faces` does.

        Parameters
        ----------
        poses
            The same mesh in each pose, as triangles. The posteriors of all poses are averaged.
        polygons
            For each pose, the polygon that each triangle belongs to. A polygon can have several triangles; -1 stands
            for a triangle without a polygon, which shapes the surface but has no label.
        min_share : float, optional
            See `segment_faces`.
        progress
            Called after each pose with the share that is done, 0 to 1. An error that it raises ends the work.
        marked : (q, 2) int array, optional
            Pairs of neighboring polygons between which a border is welcome, as at hard edges, seams and borders of
            materials: a border nearby moves there.

        Returns
        -------
        (p,) segment of each polygon, 0 to the largest number in `polygons`; -1 for a polygon without a triangle in any
        pose.

        Raises
        ------
        ValueError
            If there is no pose, or the lengths do not fit.
        """
        described = self._poses_of_mesh(poses, polygons)
        step = Progress.of_share(progress)
        return self._labeler().segments(described, polygons, self._min_share(min_share), step, marked)[0]

    @one_blas_thread
    def polygon_sides(
        self,
        poses: Sequence[AnyPose],
        polygons: Sequence[IntArray],
        labels: IntArray,
        progress: ShareFunction | Progress | None = None,
    ) -> IntArray:
        """Tell left from right where a segment lies on both sides.

        Parameters
        ----------
        poses, polygons, progress
            As for `segment_polygons`. A few of the poses vote.
        labels : (p,) int array
            Result of `segment_polygons`.

        Returns
        -------
        (p,) int array: 1 for polygons of a region on the left that has a counterpart on the right, -1 for those on the
        right, 0 for others. All 0 with the paper's setting.

        Raises
        ------
        ValueError
            As by `segment_polygons`.
        """
        described = self._poses_of_mesh(poses, polygons)
        if self.sides_ is None:
            return np.zeros(len(labels), dtype=np.int64)
        return self._labeler().sides(self.sides_, described, polygons, labels, Progress.of_share(progress))

    @property
    def n_segments_(self) -> int:
        """Number of segments of the fitted model."""
        mixture = self._fitted()
        n_groups = self._number_of_segments(mixture, self.grouping_, self.taught_)
        return n_groups if self.taught_ is None else n_groups - self.taught_.n_groups + self.taught_.n_parts

    def __sklearn_is_fitted__(self) -> bool:
        """Whether `fit` was called, or a model was loaded; for `sklearn.utils.validation.check_is_fitted`."""
        return hasattr(self, "mixture_")

    def _fitted(self) -> GaussianMixture:
        if not self.__sklearn_is_fitted__():
            from sklearn.exceptions import NotFittedError  # takes long to import

            raise NotFittedError("the model is not fitted: call fit, or load a model, first")
        return self.mixture_

    def _poses_of_mesh(self, poses: Sequence[AnyPose], polygons: Sequence[IntArray]) -> list[Workpiece]:
        """Described poses of one mesh; ValueError if there are none, or the polygons do not fit."""
        self._fitted()
        polygons = as_list(polygons, "polygons")
        described = [self._described(pose) for pose in as_list(poses, "poses")]
        if not described or len(described) != len(polygons):
            raise ValueError(
                Message("there are {poses} poses, but polygons for {given}", poses=len(described), given=len(polygons))
            )
        for i, (pose, polygon_of) in enumerate(zip(described, polygons, strict=True)):
            n_triangles = pose.surface.original.n_faces
            if np.shape(polygon_of) != (n_triangles,):
                raise ValueError(
                    Message(
                        "pose {pose} has {triangles} triangles, but polygons for {given}",
                        pose=i,
                        triangles=n_triangles,
                        given=np.shape(polygon_of),
                    )
                )
        return described

    def _min_share(self, min_share: float | None) -> float:
        """Smallest share of the area of a region; ValueError if it is out of range."""
        if min_share is None:
            return self._labeler().min_share
        if not 0 <= min_share < 1:
            raise ValueError(Message("min_share must be at least 0 and below 1, not {value!r}", value=min_share))
        return min_share

    def _labeler(self) -> Labeler:
        """Labeler with the learned mixture and the current settings."""
        mixture = self._fitted()
        learned = PartMixture(mixture, self.grouping_, self.of_bodies_, self.taught_, self.plan_)
        return self._labeler_of(learned, self.standardizer_, self.sides_)

    def _labeler_of(
        self, learned: PartMixture, standardizer: Standardizer, sides: RegionAtlas | None = None
    ) -> Labeler:
        mixture, grouping, taught = learned.mixture, learned.grouping, learned.taught
        of_mesh = taught is not None and not taught.of_bodies
        length = float(self._effective("smoothness") * (TAUGHT_LENGTH if of_mesh else SMOOTHING_LENGTH))
        n_groups = self._number_of_segments(mixture, grouping, taught)
        plan = learned.plan
        return Labeler(mixture, standardizer, grouping, n_groups, length, learned.of_bodies, taught, sides, plan)

    def _number_of_segments(
        self, mixture: GaussianMixture, grouping: MergeTree | None, taught: TaughtParts | None
    ) -> int:
        """Number of groups of components, of which a taught left and right part are one."""
        if grouping is None:
            return len(mixture.weights)
        return grouping.number_of(self.n_segments) if taught is None else taught.number_of(self.n_segments, grouping)
