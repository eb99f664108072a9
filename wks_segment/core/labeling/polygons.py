"""From posteriors at vertices to labels of polygons: short borders along creases, and no small regions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix, diags

from ..geometry.graph_cut import CutStyle, cut_borders
from ..mesh.adjacency import FaceAdjacency, FaceGraph, merge_small_regions
from ..mesh.mirror import Mirror
from ..mesh.surface import indicator
from ..mesh.triangle_mesh import BoolArray, FloatArray, IntArray
from ..poses.pose_cache import Workpiece
from ..progress import Progress

MARKED_COST = 0.1
"""Cost of a border along a marked edge, as a fraction of its cost elsewhere: low enough that a border moves to a marked
edge within reach, and high enough that marked edges alone make no border."""
AVERAGED = 0.4
"""Share of the time of labeling after which the posteriors of all poses are averaged; the graph cut cannot report."""
BEGINNING = 0.4
"""Share of a pose's progress that is reported before it is labeled, since nothing can be reported in between."""


@dataclass(frozen=True)
class Cleaning:
    """How labels are cleaned.

    Attributes
    ----------
    cut : CutStyle
        How borders are smoothed; with length 0, each polygon gets its likeliest label.
    min_share : float
        Connected regions with less than this share of the area join a neighbor.
    min_share_of_largest : float
        Connected regions with less than this share of the largest one with their label join a neighbor.
    """

    cut: CutStyle
    min_share: float
    min_share_of_largest: float = 0.0


class PolygonMesh:
    """The p polygons of a mesh in one or several poses: everything that labels need except the posteriors.

    It does not refer to the poses, because it is kept in the cache of one of them.

    Parameters
    ----------
    poses
    polygons
        For each pose, the polygon of each triangle, -1 for none; None: each triangle is a polygon.

    Attributes
    ----------
    areas : (p,) array
        Mean over the poses that show the polygon, as shares of the whole.
    sound_areas : (p,) array
        The same on the repaired surfaces, without spikes.
    neighbors : FaceAdjacency
        Of the polygons.
    """

    def __init__(self, poses: Sequence[Workpiece], polygons: Sequence[IntArray] | None) -> None:
        if polygons is None:
            polygons = [np.arange(pose.surface.original.n_faces) for pose in poses]
        n_polygons = 1 + max(int(polygon_of.max()) for polygon_of in polygons)
        self.areas, self.sound_areas, times_seen = np.zeros((3, n_polygons))
        in_poses = []
        for pose, polygon_of in zip(poses, polygons, strict=True):
            in_pose = _PolygonsInPose.of(pose, polygon_of, n_polygons)
            self.areas += in_pose.areas
            self.sound_areas += in_pose.sound_areas
            times_seen += in_pose.seen
            in_poses.append(in_pose)
        self._in_poses, self._times_seen = in_poses, times_seen
        # Borders of one mesh are the same in every pose, but modifiers may hide some of them in a pose.
        self._fullest = max(range(len(in_poses)), key=lambda i: len(in_poses[i].neighbors.pairs))
        fullest = in_poses[self._fullest]
        mean_centers = sum(in_pose.centers for in_pose in in_poses) / np.maximum(times_seen, 1)[:, None]
        self._centers = np.where(fullest.seen[:, None], fullest.centers, mean_centers)
        self.areas /= np.maximum(times_seen, 1)
        self.sound_areas /= np.maximum(times_seen, 1)
        self._mirror = fullest.mirror
        self.neighbors = fullest.neighbors

    @property
    def n_polygons(self) -> int:
        """Number of polygons."""
        return len(self.areas)

    def mean(
        self,
        poses: Sequence[Workpiece],
        posteriors_on: Callable[[Workpiece], FloatArray],
        progress: Progress,
    ) -> FloatArray:
        """(p, K) mean over triangles and poses of (m, K) posteriors on the faces of each pose.

        Progress is reported at the beginning and at the end of each pose.
        """
        total: FloatArray = np.zeros(())
        for i, (pose, in_pose) in enumerate(zip(poses, self._in_poses, strict=True)):
            progress((i + BEGINNING) / len(poses))
            total = total + in_pose.mean @ posteriors_on(pose)
            progress((i + 1) / len(poses))
        return total / np.maximum(self._times_seen, 1)[:, None]

    def of_faces(self, values: FloatArray, pose: int) -> FloatArray:
        """(p,) mean of (m,) values on the faces of one of the poses over each polygon; 0 if it does not show it."""
        return np.asarray(self._in_poses[pose].mean @ values)

    def mirrored(self, values: FloatArray) -> FloatArray:
        """(p, K) values of the polygons, averaged with those of their mirror images, if the mesh has any."""
        return values if self._mirror is None else self._mirror.mean(values)

    def labels(
        self,
        poses: Sequence[Workpiece],
        posteriors: FloatArray,
        cleaning: Cleaning,
        marked: IntArray | None = None,
    ) -> tuple[IntArray, FaceAdjacency]:
        """Clean labels of the polygons.

        Parameters
        ----------
        poses
            The same as those that this was made from.
        posteriors : (p, K) array
            Smoothed over the length of the cut.
        cleaning : Cleaning
        marked : (q, 2) int array, optional
            Neighboring polygons between which a border is welcome.

        Returns
        -------
        (p,) int array of labels, -1 for a polygon without a triangle, and the neighbors among polygons, including
        those of islands that took the label of their surroundings.
        """
        labels = np.where(self._times_seen > 0, posteriors.argmax(axis=1), -1)
        graph = FaceGraph(self.areas, self._centers, self.neighbors)
        if cleaning.cut.length > 0:
            across = self._in_poses[self._fullest].across
            weights = cleaning.cut.border_weights(poses[self._fullest].curvature[across])
            if marked is not None:
                weights = np.where(self.neighbors.among(marked), MARKED_COST * weights, weights)
            labels = cut_borders(posteriors, graph, weights, cleaning.cut, labels)
        exact = None
        if self._mirror is not None and cleaning.cut.length > 0 and self._mirror.is_exact(self.areas):
            exact = self._mirror
        if exact is not None:
            labels = exact.copied(labels)
        labels, neighbors = merge_small_regions(labels, graph, cleaning.min_share, cleaning.min_share_of_largest)
        return labels if exact is None else exact.copied(labels), neighbors


@dataclass(frozen=True)
class _PolygonsInPose:
    """The p polygons of a mesh in one pose, scaled to area 1.

    Attributes
    ----------
    seen : (p,) bool array
        Whether the polygon has a triangle.
    areas, sound_areas : (p,) arrays
        On the original mesh, and on the repaired surface.
    centers : (p, 3) array
        0 where not seen.
    mean : (p, m) sparse array
        Averages values of triangles over each polygon, by area.
    across : (b,) bool array
        Whether each pair of neighboring triangles belongs to different polygons.
    neighbors : FaceAdjacency
        Of the polygons.
    mirror : Mirror or None
        Mirror images of the polygons.
    """

    seen: BoolArray
    areas: FloatArray
    sound_areas: FloatArray
    centers: FloatArray
    mean: csr_matrix
    across: BoolArray
    neighbors: FaceAdjacency
    mirror: Mirror | None

    @classmethod
    def of(cls, pose: Workpiece, polygon_of: IntArray, n_polygons: int) -> _PolygonsInPose:
        """Polygons of a pose, given the polygon of each triangle."""
        surface, original = pose.surface, pose.surface.original
        sum_over = indicator(np.where(polygon_of < 0, n_polygons, polygon_of), n_polygons + 1)[:n_polygons]
        # A triangle without area has a tiny weight, or a polygon of such triangles would have no label.
        weight = original.face_areas / original.area + np.finfo(float).eps
        total = sum_over @ weight
        seen = np.asarray(total > 0)
        mean = csr_matrix(diags(1 / np.where(seen, total, 1)) @ sum_over @ diags(weight))
        centers, mirror = original.unit_face_centers, surface.mirror
        own = surface.face_of >= 0
        sound = np.bincount(surface.face_of[own], surface.mesh.face_areas[own] / surface.mesh.area, original.n_faces)
        return cls(
            seen,
            total * seen,
            np.asarray(sum_over @ sound),
            np.asarray(mean @ centers),
            mean,
            pose.neighbors.across(polygon_of),
            pose.neighbors.between_polygons(polygon_of),
            None if mirror is None else mirror.of_polygons(polygon_of, original.face_areas, n_polygons),
        )
