"""Segments as groups of mixture components, merged across long borders that no crease marks.

A mixture with as many components as segments cuts where the values of the signature happen to form clusters. A mixture
with more components has the borders that a person would draw among its own. Its components are merged pair by pair,
across the border that is longest for the area of the smaller side; a border counts little along creases and where the
thickness changes. Few short borders remain, which move little from pose to pose. After Hennig, "Methods for merging
Gaussian mixture components" (2010), with the geometry of the surface instead of the overlap of densities.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix

from ..geometry.agglomeration import gains_of_merging, merge_in_table
from ..geometry.creases import border_weights
from ..geometry.normalized_cuts import human_like_parts
from ..mesh.adjacency import FaceAdjacency, FaceGraph, connected_regions, merge_small_regions
from ..mesh.surface import Surface
from ..mesh.triangle_mesh import BoolArray, FloatArray, IntArray
from ..progress import Progress
from .parameters import NSegments

MIN_GROUP_SHARE = 0.01
"""Groups with less than this share of the area are merged first: otherwise each would use up a segment."""
MIN_BORDER_REGION = 0.002
"""Connected regions with less than this share of the area are ignored when borders are measured: they are noise."""
CHANGE_LENGTH = 20.0
"""Border length, in units of the square root of the area, that counts for a change of all faces from pose to pose."""
LEAST_AREA = 1e-6
"""Area that a component without any face counts as, against a division by zero."""

BEST_WITHIN, MOST_SEGMENTS = 0.06, 16
"""If the number of segments is open, it is the largest one, up to `MOST_SEGMENTS`, whose certainty is within
`BEST_WITHIN` of the best: a larger tolerance takes more segments, which agree less between poses."""
MOST_CUT = 10.0
"""Mean of border length by area over the groups above which groups are fragments of what people see as one."""


@dataclass(frozen=True)
class PoseGeometry:
    """Geometry of a training pose: neighbors, weighted borders, and reference cuts by geometry alone.

    Attributes
    ----------
    surface : Surface
    adjacency : FaceAdjacency
        Of the m original faces.
    lengths : (p,) array
        Weighted border length between neighbors, for a surface of area 1.
    cuts : (s, m) int array
        Part of each face in several reference cuts, as a person might cut this pose, coarse to fine.
    """

    surface: Surface
    adjacency: FaceAdjacency
    lengths: FloatArray
    cuts: IntArray

    @classmethod
    def of(cls, surface: Surface, progress: Progress | None = None) -> PoseGeometry:
        """Find the neighbors, weight their borders and cut the surface."""
        original = surface.original
        adjacency = FaceAdjacency.of(surface.welded_faces, original.vertices)
        weights, curvature = border_weights(surface, adjacency, progress or Progress())
        lengths = weights * adjacency.lengths / np.sqrt(original.area)
        return cls(surface, adjacency, lengths, human_like_parts(surface, adjacency, lengths, curvature))

    def rand_error(self, labels: IntArray) -> float:
        """Rand-index error of the connected regions of (m,) labels against the reference cuts, by area (Rand, 1971).

        Mean over the cuts.
        """
        region = connected_regions(labels, self.adjacency)
        shares = self.surface.original.face_areas / self.surface.original.area
        errors = []
        for cut in self.cuts:
            both = coo_matrix((shares, (region, cut))).tocsr()
            both.sum_duplicates()
            separate = np.square(np.bincount(region, shares)).sum() + np.square(np.bincount(cut, shares)).sum()
            errors.append(separate - 2 * np.square(both.data).sum())
        return float(np.mean(errors))


@dataclass(frozen=True)
class Contacts:
    """Borders, areas and overlaps of the K components of a mixture on one or several poses.

    Attributes
    ----------
    borders : (K, K) array
        Weighted border length between two components, for a surface of area 1.
    areas : (K,) array
        Share of the area.
    overlaps : (K, K) array
        Share of the area that both components claim: Σ over faces of area times both posteriors.
    """

    borders: FloatArray
    areas: FloatArray
    overlaps: FloatArray

    @classmethod
    def on(cls, geometry: PoseGeometry, posteriors: FloatArray) -> Contacts:
        """Contacts on one pose, given (m, K) smoothed posteriors of its faces."""
        n_components = posteriors.shape[1]
        original, adjacency = geometry.surface.original, geometry.adjacency
        graph = FaceGraph(original.face_areas, original.face_centers, adjacency)
        labels, _ = merge_small_regions(posteriors.argmax(axis=1), graph, MIN_BORDER_REGION)
        shares = original.face_areas / original.area
        a, b = labels[adjacency.pairs].T
        borders, areas = np.zeros((n_components, n_components)), np.zeros(n_components)
        np.add.at(borders, (a, b), geometry.lengths * (a != b))
        np.add.at(areas, labels, shares)
        return cls(borders + borders.T, areas, np.asarray(posteriors.T @ (posteriors * shares[:, None])))

    @classmethod
    def mean(cls, poses: Sequence[Contacts]) -> Contacts:
        """Mean over several poses, each with the same weight."""
        return cls(*(np.mean([getattr(pose, name) for pose in poses], axis=0) for name in cls.__dataclass_fields__))

    def with_changes(self, posteriors: FloatArray) -> Contacts:
        """The same contacts with more border between components that replace each other from pose to pose.

        Without it, what a pose changes would become a segment of its own. Given (p, f, K) posteriors of f faces with
        equal shares of the area in p ≥ 2 poses of one mesh.
        """
        n_poses, n_faces, n_components = posteriors.shape
        counts = np.zeros((n_faces, n_components))
        np.add.at(counts, (np.arange(n_faces), posteriors.argmax(axis=2)), 1)
        changes = counts.T @ counts / (n_faces * n_poses * (n_poses - 1))
        np.fill_diagonal(changes, 0)
        return Contacts(self.borders + CHANGE_LENGTH * changes, self.areas, self.overlaps)


@dataclass(frozen=True)
class MergeTree:
    """Order in which K components are merged into groups: a binary tree, with quality measures at each level.

    Attributes
    ----------
    pairs : (K − 1, 2) array of int
        The two groups that each step merges, the larger one first. The merged group keeps the name of the larger one; a
        group of one component has the name of this component.
    certainties : (K,) array
        Certainty with 1, 2, … K groups: Σ over faces of area times the squares of the posteriors, which is low where
        wide borders are long. It predicts how well the labels of unseen poses will agree.
    by_chance : (K,) array
        Certainty that would remain if only the sizes of the groups were known.
    cuts : (K,) array
        Mean over the groups of weighted border length by area, with 1, 2, … K groups, for a surface of area 1.
    """

    pairs: IntArray
    certainties: FloatArray
    by_chance: FloatArray
    cuts: FloatArray

    @classmethod
    def of(cls, contacts: Contacts, scattered: BoolArray | None = None) -> MergeTree:
        """Merge the components of a mixture, best pair first, until one group is left.

        Small components, and those marked in (K,) `scattered`, are merged before all others.
        """
        borders, overlaps = contacts.borders.copy(), contacts.overlaps.copy()
        areas = np.maximum(contacts.areas, LEAST_AREA)
        count = len(areas)
        alive = np.ones(count, dtype=bool)
        scattered = np.zeros(count, dtype=bool) if scattered is None else scattered.copy()
        pairs, cuts = np.zeros((count - 1, 2), dtype=np.int64), np.zeros(count)
        name = np.arange(count)
        certainties, by_chance = np.ones(count), np.ones(count)
        for step in range(count - 1):
            certainties[count - 1 - step] = np.trace(overlaps)
            by_chance[count - 1 - step] = np.square(overlaps.sum(axis=1)).sum()
            np.fill_diagonal(borders, 0)
            cuts[count - 1 - step] = min(np.mean((borders.sum(axis=1) / areas)[alive]), 1 / LEAST_AREA)
            gain = gains_of_merging(borders, borders.sum(axis=1), areas)
            touch = borders > 0
            small = (np.minimum(areas[:, None], areas) < MIN_GROUP_SHARE) | scattered[:, None] | scattered
            # Small groups come before large ones, then groups that touch before others; each rule outweighs the rest.
            rank = 4.0 * small + 2.0 * touch + np.where(touch, gain / (1 + np.abs(gain)), overlaps)
            rank[~np.triu(alive[:, None] & alive, 1)] = -np.inf
            i, j = divmod(int(rank.argmax()), count)
            larger, smaller = (i, j) if areas[i] >= areas[j] else (j, i)
            pairs[step] = name[larger], name[smaller]
            name[i] = name[larger]
            for table in (borders, overlaps):
                merge_in_table(table, i, j)
            areas[i] += areas[j]
            scattered[i] &= scattered[j]
            scattered[j] = alive[j] = False
        return cls(pairs, certainties, by_chance, cuts)

    def groups(self, n_groups: int) -> IntArray:
        """(K,) group of each component when `n_groups` are left.

        Groups are numbered in the reverse order of the merges: one group more splits off the one with the last number
        and leaves the others as they are, so that names and colors stay where they were.
        """
        merges = len(self.certainties) - n_groups
        owner = np.arange(len(self.certainties))
        for i, j in self.pairs[:merges]:
            owner[owner == j] = i
        number = np.zeros(len(owner), dtype=np.int64)
        for count, (_, split_off) in enumerate(self.pairs[merges:][::-1], start=1):
            number[split_off] = count
        return np.asarray(number[owner])

    def curve(self) -> FloatArray:
        """(K,) certainty with 1, 2, … K groups beyond chance: 1 if all faces are certain, 0 if only sizes are known.

        Corrected for chance like Cohen's kappa, so that numbers of groups can be compared; 0 for one group.
        """
        beyond = 1 - self.by_chance
        return np.asarray((self.certainties - self.by_chance) / np.where(beyond > 0, beyond, 1))

    def best_number(self) -> int:
        """Largest number of groups whose certainty is close to the best; at least 2 if there are 2 components."""
        curve = self.curve()[1:MOST_SEGMENTS]
        if not len(curve):
            return 1
        return 2 + int(np.flatnonzero(curve >= curve.max() - BEST_WITHIN)[-1])

    def number_of(self, n_segments: NSegments) -> int:
        """Number of groups for a parameter `n_segments`: itself, or the best number for "auto"."""
        return self.best_number() if n_segments == "auto" else n_segments

    def number_of_wholes(self, most: int) -> int:
        """Largest number of groups, up to `most`, that are no fragments: their borders are short for their areas.

        With fewer groups than these, all of them are whole as well.
        """
        fragmented = np.flatnonzero(self.cuts[:most] > MOST_CUT)
        return max(int(fragmented[0]) if len(fragmented) else most, min(most, 2))
