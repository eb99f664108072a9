"""Connected regions of a pose, and the traits that tell them apart in any pose and on any meshing.

Signatures are the same on the left and on the right. Two mirrored regions cover the same patch of signature space, but
with opposite orientation: for two functions f and g of the signature, df ∧ dg is the signed area that a
face covers in the plane (f, g). Its sum, weighted by a function that is positive near a region and negative near the
other regions of its segment, tells left from right by the surroundings. After Ren, Poulenard, Wonka and Ovsjanikov,
"Continuous and orientation-preserving correspondences via functional maps" (2018), whose operator keeps a map from
exchanging left and right. Here there is no map, only a few numbers for each region.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..mesh.adjacency import FaceAdjacency, connected_regions
from ..mesh.surface import shares_at_vertices
from ..mesh.triangle_mesh import FloatArray, IntArray, TriangleMesh
from ..poses.pose_cache import Workpiece
from ..spectral.laplacian import unit_area_masses

FIELDS = 6
"""Number of functions of the signature that regions are told apart by; `PLANES` grows with its square."""
PLANES = FIELDS * (FIELDS - 1) // 2
SURROUNDINGS = 0.3
"""Radius of the surroundings of a region, in units of the square root of the area."""
LEAST_OVERLAP = 1e-6
"""Lower bound of areas, and of the overlap of the heat of two regions: their distance comes from its logarithm, which
must be finite."""
MOST_TRAITS = 200
"""Maximum number of regions of a pose that have traits, the largest ones: time and model files grow with its square."""


@dataclass(frozen=True)
class Regions:
    """Connected regions of a pose.

    Attributes
    ----------
    region : (m,) int array
        Region of each face. The r largest regions have the numbers 0, 1, …, r − 1, all others higher ones.
    segment : (r,) int array
        Segment of each of the r largest regions.
    """

    region: IntArray
    segment: IntArray

    @classmethod
    def of(
        cls, labels: IntArray, adjacency: FaceAdjacency, original: TriangleMesh, segment_of_label: IntArray
    ) -> Regions:
        """Regions of a mesh, given labels of the faces, the neighbors among faces, and the segment of each label."""
        region = connected_regions(labels, adjacency)
        segment_of = np.zeros(int(region.max()) + 1, dtype=np.int64)
        segment_of[region] = segment_of_label[labels]
        largest = np.argsort(-np.bincount(region, original.face_areas), kind="stable")[:MOST_TRAITS]
        order = np.append(np.sort(largest), np.setdiff1d(np.arange(len(segment_of)), largest))
        return cls(np.argsort(order)[region], segment_of[np.sort(largest)])

    def traits(self, pose: Workpiece, fields: FloatArray) -> Traits:
        """Traits of the r largest regions in a pose, given the (n', FIELDS) fields on its surface."""
        large = np.where(self.region < len(self.segment), self.region, -1)
        return Traits.of(pose, fields, large, self.segment)

    def centers(self, mesh: TriangleMesh) -> FloatArray:
        """(r, 3) centers of the r largest regions, in units of the square root of the area; x is 0 in the middle."""
        places = mesh.unit_face_centers
        middle = np.average(places[:, 0], weights=mesh.face_areas)
        count = int(self.region.max()) + 1
        weights = mesh.face_areas + np.finfo(float).tiny
        sums = np.stack([np.bincount(self.region, weights * axis, count) for axis in places.T], axis=1)
        centers = sums / np.bincount(self.region, weights, count)[:, None]
        return np.asarray(centers[: len(self.segment)] - (middle, 0, 0))

    def numbered(self, numbers: IntArray, n_known: int) -> IntArray:
        """(m,) number of the region of each face, given the numbers of the r largest regions.

        All others get new numbers, from `n_known` or above the highest given number.
        """
        n_others = int(self.region.max()) + 1 - len(numbers)
        first = max(n_known, int(numbers.max()) + 1)
        return np.append(numbers, first + np.arange(n_others))[self.region]


@dataclass(frozen=True)
class Traits:
    """Traits that tell the r connected regions of a mesh apart; about the same in any pose and on any meshing.

    Attributes
    ----------
    segment : (r,) int array
    area : (r,) array
        Share of the whole area.
    signature : (r, FIELDS) array
        Mean of the fields over the region.
    handedness : (r, PLANES) array
        Σ over faces of h df ∧ dg for all pairs of fields, where h is the heat of the region minus the mean heat of the
        other regions of its segment; 0 if there are none. It has the opposite sign at the mirrored region.
    distance : (r, r) array
        Distance between regions, from the overlap of their heat (Varadhan, 1967), in units of the square root of the
        area.
    """

    segment: IntArray
    area: FloatArray
    signature: FloatArray
    handedness: FloatArray
    distance: FloatArray

    @classmethod
    def of(cls, pose: Workpiece, fields: FloatArray, region: IntArray, segment: IntArray) -> Traits:
        """Traits of regions of one pose.

        Parameters
        ----------
        pose : Workpiece
            With n' vertices on its surface and m original faces.
        fields : (n', FIELDS) array
            Functions of the signature.
        region : (m,) int array
            Region of each face, 0 to r − 1; -1 for a face without a region.
        segment : (r,) int array
            Segment of each region.
        """
        surface, mesh, original = pose.surface, pose.surface.mesh, pose.surface.original
        count = len(segment)
        area = np.bincount(region[region >= 0], original.face_areas[region >= 0], count) / original.area
        masses = unit_area_masses(mesh)
        inside = shares_at_vertices(surface, region, count)
        heat = pose.flows.over(SURROUNDINGS).smooth(inside).astype(np.float64)
        weighted = inside * masses[:, None]
        signature = weighted.T @ fields / np.maximum(weighted.sum(axis=0), LEAST_OVERLAP)[:, None]
        contrast = np.where(segment[:, None] == segment, -1.0, 0.0)
        np.fill_diagonal(contrast, 0)
        contrast /= np.maximum(-contrast.sum(axis=0), 1)
        np.fill_diagonal(contrast, (contrast != 0).any(axis=0))
        handedness = (heat @ contrast)[mesh.faces].mean(axis=1).T @ _signed_areas(pose, fields)
        overlap = heat.T @ (heat * masses[:, None]) / masses.sum()
        size = np.sqrt(np.maximum(area, LEAST_OVERLAP))
        distance = -SURROUNDINGS * np.log(np.maximum(overlap / np.outer(size, size), LEAST_OVERLAP))
        # Rounding may let a small region overlap itself by more than its area.
        return cls(segment, np.maximum(area, LEAST_OVERLAP), signature, handedness, np.maximum(distance, 0))


def fields_of(means: FloatArray, weights: FloatArray, samples: FloatArray) -> FloatArray:
    """(n, FIELDS) samples along the axes on which the components of a mixture lie farthest apart.

    Given the (K, d) means and (K,) weights of the components, and (n, d) samples.
    """
    axes = np.linalg.eigh((means * weights[:, None]).T @ means)[1][:, ::-1][:, :FIELDS]
    # The library chooses the signs of the axes; a model must mean the same on every machine.
    axes *= np.sign(axes[np.abs(axes).argmax(axis=0), np.arange(axes.shape[1])])
    fields = samples @ axes
    return np.pad(fields, ((0, 0), (0, FIELDS - axes.shape[1])))


def mean_traits(poses: Sequence[Traits]) -> Traits:
    """Mean over poses that have the same regions in the same order."""
    return mean_of_numbered(poses[0], poses, [np.arange(len(poses[0].segment))] * len(poses))


def mean_of_numbered(first: Traits, poses: Sequence[Traits], numbers: Sequence[IntArray]) -> Traits:
    """Traits of each region of `first`, averaged over poses (areas: geometric mean).

    `numbers[i][j]` is the region of `first` that region j of pose i is; regions that `first` lacks have higher numbers.
    """
    count = len(first.segment)
    area, signature, handedness = np.zeros(count), np.zeros((count, FIELDS)), np.zeros((count, PLANES))
    times_seen, distance = np.zeros(count), np.zeros((count, count))
    times_both_seen = np.zeros((count, count))
    for pose, number in zip(poses, numbers, strict=True):
        known = np.flatnonzero(number < count)
        at = number[known]
        times_seen[at] += 1
        area[at] += np.log(pose.area[known])
        signature[at] += pose.signature[known]
        handedness[at] += pose.handedness[known]
        distance[np.ix_(at, at)] += pose.distance[np.ix_(known, known)]
        times_both_seen[np.ix_(at, at)] += 1
    seen, times = times_seen > 0, np.maximum(times_seen, 1)
    return Traits(
        first.segment,
        np.where(seen, np.exp(area / times), first.area),
        np.where(seen[:, None], signature / times[:, None], first.signature),
        np.where(seen[:, None], handedness / times[:, None], first.handedness),
        np.where(times_both_seen > 0, distance / np.maximum(times_both_seen, 1), first.distance),
    )


def deviation_of_numbered(mean: Traits, poses: Sequence[Traits], numbers: Sequence[IntArray]) -> FloatArray:
    """(4,) standard deviation over regions and poses of log area, signature, handedness and distance."""
    squares, count = np.zeros(4), len(mean.segment)
    times_seen = np.zeros(2)
    for pose, number in zip(poses, numbers, strict=True):
        known = np.flatnonzero(number < count)
        at = number[known]
        both = np.ix_(known, known), np.ix_(at, at)
        squares += (
            np.sum((np.log(pose.area[known]) - np.log(mean.area[at])) ** 2),
            np.sum((pose.signature[known] - mean.signature[at]) ** 2) / FIELDS,
            np.sum((pose.handedness[known] - mean.handedness[at]) ** 2) / PLANES,
            np.sum((pose.distance[both[0]] - mean.distance[both[1]]) ** 2),
        )
        times_seen += len(known), len(known) ** 2
    # Bessel's correction: the mean is over the same poses.
    correction = len(poses) / (len(poses) - 1)
    return np.asarray(np.sqrt(correction * squares / np.maximum(times_seen[[0, 0, 0, 1]], 1)))


def _signed_areas(pose: Workpiece, fields: FloatArray) -> FloatArray:
    """(m', PLANES) signed area that each face covers in the plane of each pair of (n', FIELDS) fields."""
    corners = fields[pose.surface.mesh.faces].astype(np.float64)
    u, v = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    f, g = np.triu_indices(FIELDS, 1)
    return np.asarray((u[:, f] * v[:, g] - u[:, g] * v[:, f]) / 2 * pose.normals.signs[:, None])
