"""Regions of a mesh that grow into parts: the two neighbors that are most likely one part are merged, again and again.

How likely two neighbors are one part is told by seven measures of their common border and of the two sides, and by how
far they turn apart when the mesh moves. The weights of the measures are those of a logistic regression on cuts that
people made through ninety shapes of nine classes; each class is cut about as well by weights that were fitted to the
other eight ("Parts by shape and motion" in docs/dev/experiments.md).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..geometry.agglomeration import merge_in_table
from ..geometry.creases import MOST_CONCAVE, weights_of_borders
from ..mesh.adjacency import FaceAdjacency
from ..mesh.canonical import in_steps
from ..mesh.mirror import is_exact
from ..mesh.triangle_mesh import BoolArray, FloatArray, IntArray
from ..progress import Progress
from .evidence import Evidence
from .motion import APART, edge_correlations, shares_turning, turns
from .patches import patches_of
from .visibility import visible

SMALLER_AREA, LARGER_AREA, CONCAVITY, VISIBILITY, THICKNESS, GAIN, WEIGHT, OFFSET = (
    -0.2, -0.165, -0.29, 2.417, -1.109, 0.21, -0.315, -2.262,
)  # fmt: skip
"""Weights of the logarithms of the two areas, of the mean concavity of the border, of the share of lines of sight that
are free, of the difference of log thickness, of the logarithms of the gain of normalized cuts and of the mean weight of
the border; and the constant term."""
TURN_WEIGHT, TURN_AREA, TURN_POWER = 49.0, 1 / 3, 1.5
"""With a turn by t radians between two regions, the smaller of area a, and odds o by shape, the odds that they are
one part are `(TURN_WEIGHT * a ** TURN_AREA * t + o ** (-1 / TURN_POWER)) ** -TURN_POWER`. On eleven rigs the odds fall
with the power 1.5 of the turn and 0.5 of the area; the weight is the best of four on 22 rigs."""
TOGETHER, CHANCES = 1.0, 4
"""Log-odds added for two regions that do not turn apart, for each pose after the first, up to a number of poses, times
the share of the area that turns apart from both: what moves as one again and again while other places move is one
part."""
VIEWERS = 2
"""Number of poses in which lines of sight are followed."""
TINY = 1e-12
"""Least area, against a division by zero."""


@dataclass
class PartGraph:
    """Regions of a mesh with what is summed over their borders and faces; merging adds rows and columns.

    Attributes
    ----------
    patch : (m,) int array
        Patch of each face.
    owner : (n,) int array
        Region that each patch belongs to now; a region has the number of one of its patches.
    alive : (n,) bool array
        Whether each number is one of a region.
    areas : (n,) array
    thickness : (n,) array
        Sum over the faces of area times log thickness.
    correlations : (n, q, 3, 3) array
        See `edge_correlations`.
    turning : (n,) array
        Sum over the faces of area times the share of the whole area that turns apart from them, times the number of
        poses after the first, up to `CHANCES`.
    signatures : (n, d) array
        Sum over the faces of area times signature, in any space.
    lengths, weighted, concavities : (n, n) arrays
        Sums over the common border: length, weighted length, and length times concavity.
    sights : (n, n) array
        Sums over pairs of patches: product of the areas of those that see each other.
    likeness : (n, n) array
        Log-odds that two neighbors are one part; −inf for regions that do not touch.
    mirrored : (n,) int array or None
        Mirror image of each patch; None if the mesh is not its own mirror image.
    """

    patch: IntArray
    owner: IntArray
    alive: BoolArray
    areas: FloatArray
    thickness: FloatArray
    correlations: FloatArray
    turning: FloatArray
    signatures: FloatArray
    lengths: FloatArray
    weighted: FloatArray
    concavities: FloatArray
    sights: FloatArray
    likeness: FloatArray
    mirrored: IntArray | None = None

    @classmethod
    def of(cls, evidence: Evidence, signature: FloatArray, progress: Progress | None = None) -> PartGraph:
        """Patches of a mesh as the first regions, given (m, d) values of the faces to be summed as signatures."""
        areas, neighbors = evidence.areas, evidence.neighbors
        patch = np.empty(len(areas), dtype=np.int64)
        patch[evidence.order] = patches_of(*_in_order(evidence))
        count = int(patch.max()) + 1
        weight = weights_of_borders(neighbors.pairs, evidence.centers, evidence.curvature, evidence.thickness)
        concave = np.clip(-evidence.curvature, 0, MOST_CONCAVE)
        first, second = patch[neighbors.pairs].T
        across = first != second

        def table(values: FloatArray) -> FloatArray:
            sums = np.zeros((count, count))
            np.add.at(sums, (first[across], second[across]), values[across])
            return sums + sums.T

        patch_areas = np.maximum(np.bincount(patch, areas, count), TINY)
        middle = _middle_faces(patch, evidence)
        viewers = evidence.poses[:VIEWERS]
        seen = np.mean([visible(pose, middle, step) for pose, step in Progress.of(progress).each(viewers)], axis=0)
        meshes = [pose.surface.original for pose in evidence.poses]
        correlations = edge_correlations(meshes, patch)
        graph = cls(
            patch,
            np.arange(count),
            np.ones(count, dtype=bool),
            patch_areas,
            np.bincount(patch, areas * evidence.thickness, count).astype(np.float64),
            correlations,
            min(len(meshes) - 1, CHANCES) * shares_turning(correlations, patch_areas) * patch_areas,
            np.stack([np.bincount(patch, areas * column, count) for column in signature.T], axis=1),
            table(neighbors.lengths),
            table(neighbors.lengths * weight),
            table(neighbors.lengths * concave),
            seen * np.outer(patch_areas, patch_areas),
            np.full((count, count), -np.inf),
        )
        graph.mirrored = _mirrored_patches(patch, evidence)
        if graph.mirrored is not None:
            graph._share_evidence(graph.mirrored)
        touching = np.nonzero(np.triu(graph.lengths > 0, 1))
        graph._measure(*touching)
        return graph

    @property
    def regions(self) -> IntArray:
        """Numbers of the regions that are left."""
        return np.flatnonzero(self.alive)

    def region_of_faces(self) -> IntArray:
        """(m,) region of each face."""
        return self.owner[self.patch]

    def mean_signatures(self) -> FloatArray:
        """(r, d) mean signature of each of `regions`."""
        regions = self.regions
        return self.signatures[regions] / self.areas[regions, None]

    def touching(self) -> BoolArray:
        """(r, r) which of `regions` touch."""
        regions = self.regions
        return np.asarray(self.lengths[np.ix_(regions, regions)] > 0)

    def ties(self) -> FloatArray:
        """(r, r) log-odds that two of `regions` are one part, 0 where they are rather two, or do not touch."""
        regions = self.regions
        return np.asarray(np.maximum(self.likeness[np.ix_(regions, regions)], 0))

    def merge(self, first: int, second: int) -> int:
        """Merge two regions; returns the number of the larger one, which stays."""
        kept, gone = (first, second) if self.areas[first] >= self.areas[second] else (second, first)
        for table in (self.lengths, self.weighted, self.concavities):
            merge_in_table(table, kept, gone)
            table[kept, kept] = 0
        merge_in_table(self.sights, kept, gone)
        for sums in (self.areas, self.thickness, self.correlations, self.turning, self.signatures):
            sums[kept] += sums[gone]
        self.areas[gone] = TINY
        self.alive[gone] = False
        self.owner[self.owner == gone] = kept
        for number in (kept, gone):
            self.likeness[number] = self.likeness[:, number] = -np.inf
        around = np.flatnonzero((self.lengths[kept] > 0) & self.alive)
        self._measure(np.full(len(around), kept), around)
        return kept

    def merge_both(self, first: int, second: int, least: float) -> None:
        """Merge two regions, and their mirror images: which of two equal pairs comes first must not decide.

        Mirror images of which one has been merged already are merged if their log-odds are not below `least`.
        """
        images = None
        if self.mirrored is not None:
            images = self.owner[self.mirrored[first]], self.owner[self.mirrored[second]]
        self.merge(first, second)
        if images is not None:
            apart = not {first, second} & set(map(int, images))
            one, other = (int(self.owner[image]) for image in images)
            if one != other and self.likeness[one, other] >= (-np.finfo(float).max if apart else least):
                self.merge(one, other)

    def _share_evidence(self, mirrored: IntArray) -> None:
        """Give mirrored regions the same evidence, given the (n,) mirror image of each patch."""
        for sums in (self.areas, self.thickness, self.turning, self.signatures):
            sums += sums[mirrored]
            sums /= 2
        for table in (self.lengths, self.weighted, self.concavities, self.sights):
            table += table[np.ix_(mirrored, mirrored)]
            table /= 2
        # Turns are means over pairs of poses: those of the mirror image count as further pairs.
        self.correlations = np.concatenate([self.correlations, self.correlations[mirrored]], axis=1)

    def _measure(self, first: IntArray, second: IntArray) -> None:
        """Measure how likely pairs of neighbors are one part."""
        areas = self.areas
        low, high = np.minimum(areas[first], areas[second]), np.maximum(areas[first], areas[second])
        length = np.maximum(self.lengths[first, second], TINY)
        weighted = self.weighted[first, second]
        border = self.weighted.sum(axis=1)
        thickness = self.thickness / areas
        gain = _gains(weighted, border[first], border[second], areas[first], areas[second])
        shape = (
            OFFSET
            + SMALLER_AREA * np.log(low)
            + LARGER_AREA * np.log(high)
            + CONCAVITY * self.concavities[first, second] / length
            + VISIBILITY * self.sights[first, second] / (low * high)
            + THICKNESS * np.abs(thickness[first] - thickness[second])
            + GAIN * np.log(np.maximum(gain, 1e-3))
            + WEIGHT * np.log(np.maximum(weighted, 1e-6) / length)
        )
        turn = turns(self.correlations[first], self.correlations[second], areas[first], areas[second])
        apart = TURN_WEIGHT * low**TURN_AREA * turn + np.exp(-shape / TURN_POWER)
        turning = self.turning / areas
        together = TOGETHER * np.minimum(turning[first], turning[second]) * np.exp(-turn / APART)
        self.likeness[first, second] = self.likeness[second, first] = together - TURN_POWER * np.log(apart)


def _gains(cut: FloatArray, first: FloatArray, second: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
    """(k,) decrease of the sum over the regions of border by area when two are merged, given borders and areas.

    The energy of normalized cuts (Golovinskiy and Funkhouser, "Randomized cuts for 3D mesh analysis", 2008).
    """
    return np.asarray(first / low + second / high - (first + second - 2 * cut) / (low + high))


def _mirrored_patches(patch: IntArray, evidence: Evidence) -> IntArray | None:
    """(n,) mirror image of each patch; None if the mesh is not its own mirror image."""
    image = evidence.image
    if image is None or not is_exact(image, evidence.areas):
        return None
    count, own = int(patch.max()) + 1, image >= 0
    common = np.zeros((count, count))
    np.add.at(common, (patch[own], patch[image[own]]), evidence.areas[own])
    mirrored = common.argmax(axis=1)
    # A patch across the mirror plane may hold what is left of the image of another one: it is its own image.
    own_number = np.arange(count)
    return np.where(mirrored[mirrored] == own_number, mirrored, own_number)


def _in_order(evidence: Evidence) -> tuple[FloatArray, FloatArray, FaceAdjacency, FloatArray, IntArray | None]:
    """What patches depend on, with the faces in an order that depends on the shape alone."""
    order, neighbors, image = evidence.order, evidence.neighbors, evidence.image
    place = np.empty_like(order)
    place[order] = np.arange(len(order))
    if image is not None:
        image = np.where(image[order] >= 0, place[image[order]], -1)
    adjacency = FaceAdjacency(place[neighbors.pairs], neighbors.lengths)
    return evidence.centers[order], evidence.areas[order], adjacency, evidence.fine_curvature, image


def _middle_faces(patch: IntArray, evidence: Evidence) -> IntArray:
    """(n,) face of each patch whose center is nearest to the middle of the patch."""
    patch, centers, areas = patch[evidence.order], evidence.centers[evidence.order], evidence.areas[evidence.order]
    count = int(patch.max()) + 1
    total = np.maximum(np.bincount(patch, areas, count), TINY)
    middles = np.stack([np.bincount(patch, areas * axis, count) for axis in centers.T], axis=1) / total[:, None]
    distances = in_steps(np.linalg.norm(centers - middles[patch], axis=1))
    nearest_first = np.lexsort((distances, patch))
    return evidence.order[nearest_first[np.searchsorted(patch[nearest_first], np.arange(count))]]
