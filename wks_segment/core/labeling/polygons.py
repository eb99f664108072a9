"""From posteriors at vertices to clean labels of faces or polygons: smooth borders along creases, no crumbs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix, diags

from ..geometry.graph_cut import CUT_CREASE, CUT_WIDTH, CutStyle, cut_borders
from ..mesh.adjacency import FaceAdjacency, FaceGraph, merge_small_regions
from ..mesh.surface import indicator
from ..mesh.triangle_mesh import BoolArray, FloatArray, IntArray
from ..poses.pose_cache import Workpiece

MARKED = 0.1
"""What a border at a marked edge costs, as a share of what it would."""


class PosedMesh:
    """Where the p polygons of a mesh lie, in one or several poses: all that labels need but the posteriors.

    It does not hold the poses, which may hold it.

    Parameters
    ----------
    poses
    polygons
        For each pose, the polygon of each triangle, -1 for none; None: each triangle is one.

    Attributes
    ----------
    areas : (p,) array
        Mean over the poses that show the polygon, as shares of the whole.
    neighbors : FaceAdjacency
        Of the polygons.
    """

    def __init__(self, poses: Sequence[Workpiece], polygons: Sequence[IntArray] | None) -> None:
        if polygons is None:
            polygons = [np.arange(pose.surface.original.n_faces) for pose in poses]
        n_polygons = 1 + max(int(polygon_of.max()) for polygon_of in polygons)
        self.areas, times_seen = np.zeros(n_polygons), np.zeros(n_polygons)
        layouts = []
        for pose, polygon_of in zip(poses, polygons, strict=True):
            layout = _Layout.of(pose, polygon_of, n_polygons)
            self.areas += layout.areas
            times_seen += layout.seen
            layouts.append(layout)
        self._layouts, self._times_seen = layouts, times_seen
        # Of one mesh the borders are the same in every pose; modifiers may hide some of them in one.
        most = max(range(len(layouts)), key=lambda i: len(layouts[i].neighbors.pairs))
        self._most, layout = most, layouts[most]
        others = sum(other.centers for other in layouts) / np.maximum(times_seen, 1)[:, None]
        self._centers = np.where(layout.seen[:, None], layout.centers, others)
        self.areas /= np.maximum(times_seen, 1)
        self.neighbors = layout.neighbors

    @property
    def n_polygons(self) -> int:
        """Number of polygons."""
        return len(self.areas)

    def mean(
        self,
        poses: Sequence[Workpiece],
        posteriors_on: Callable[[Workpiece], FloatArray],
        progress: Callable[[float], None] | None = None,
    ) -> FloatArray:
        """(p, K) mean over triangles and poses of (n', K) posteriors at the vertices of each pose.

        `progress` is called after each pose with the share that is done, 0 to 1.
        """
        total: FloatArray = np.zeros(())
        for i, (pose, layout) in enumerate(zip(poses, self._layouts, strict=True)):
            total = total + layout.mean @ pose.surface.to_faces(posteriors_on(pose))
            if progress:
                progress((i + 1) / len(poses))
        return total / np.maximum(self._times_seen, 1)[:, None]

    def labeled(
        self,
        poses: Sequence[Workpiece],
        posteriors: FloatArray,
        length: float,
        least_share: float,
        marked: IntArray | None = None,
        crease: float = CUT_CREASE,
        width: float = CUT_WIDTH,
        least_of_largest: float = 0.0,
    ) -> tuple[IntArray, FaceAdjacency]:
        """Label the polygons, and clean the labels.

        Parameters
        ----------
        poses
            As they were given.
        posteriors : (p, K) array
            Smoothed over `length`.
        length : float
            Smoothing length in units of the square root of the area; 0: the likeliest label of each polygon.
        least_share : float
            Connected parts under this share of the area join a neighbor.
        marked : (q, 2) int array, optional
            Neighboring polygons between which a border is welcome.
        crease, width : float
            How much creases draw borders, and over how many smoothing lengths; see `CutStyle`.
        least_of_largest : float
            Connected parts under this share of the largest one with their label do, too.

        Returns
        -------
        (p,) int array of labels, -1 for a polygon without a triangle, and the neighbors among polygons, with loose
        pieces tied to what adopted them.
        """
        labels = np.where(self._times_seen > 0, posteriors.argmax(axis=1), -1)
        graph = FaceGraph(self.areas, self._centers, self.neighbors)
        if length > 0:
            style = CutStyle(length, crease, width)
            layout = self._layouts[self._most]
            weights = style.border_weights(poses[self._most].curvature[layout.across])
            if marked is not None:
                weights = np.where(self.neighbors.among(marked), MARKED * weights, weights)
            labels = cut_borders(posteriors, graph, weights, style, labels)
        return merge_small_regions(labels, graph, least_share, least_of_largest)


@dataclass(frozen=True)
class _Layout:
    """Where the p polygons of a mesh lie in one pose, of area 1.

    Attributes
    ----------
    seen : (p,) bool array
        Whether any triangle is of the polygon.
    areas : (p,) array
    centers : (p, 3) array
        0 where not seen.
    mean : (p, m) sparse array
        From triangles to polygons, by area.
    across : (b,) bool array
        Which of the neighbors among the triangles are of different polygons.
    neighbors : FaceAdjacency
        Of the polygons.
    """

    seen: BoolArray
    areas: FloatArray
    centers: FloatArray
    mean: csr_matrix
    across: BoolArray
    neighbors: FaceAdjacency

    @classmethod
    def of(cls, pose: Workpiece, polygon_of: IntArray, n_polygons: int) -> _Layout:
        """Given the polygon of each triangle."""
        original = pose.surface.original
        sum_over = indicator(np.where(polygon_of < 0, n_polygons, polygon_of), n_polygons + 1)[:n_polygons]
        # A triangle without area still speaks, if very softly, or its polygon would have no label.
        weight = original.face_areas / original.area + np.finfo(float).eps
        total = sum_over @ weight
        seen = np.asarray(total > 0)
        mean = csr_matrix(diags(1 / np.where(seen, total, 1)) @ sum_over @ diags(weight))
        centers = original.unit_face_centers
        return cls(
            seen,
            total * seen,
            np.asarray(mean @ centers),
            mean,
            pose.neighbors.across(polygon_of),
            pose.neighbors.between_polygons(polygon_of),
        )
