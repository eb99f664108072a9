"""Segments as groups of mixture components that long, unmarked borders hold together.

A mixture with as many components as segments cuts where the signature's values happen to cluster; a finer one also has
the borders that a person would draw, among others. Its components are joined, pair by pair, across the border that is
longest for the smaller side's area, where a border counts little along creases and where the thickness changes: what
is left are few short borders, which move little from pose to pose. After Hennig, "Methods for merging Gaussian mixture
components" (2010), with the surface's own geometry in the place of the densities' overlap.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix

from ..geometry.agglomeration import gains_of_joining, join_in_table
from ..geometry.creases import border_weights
from ..geometry.normalized_cuts import human_like_parts
from ..mesh.adjacency import FaceAdjacency, FaceGraph, connected_regions, merge_small_regions
from ..mesh.surface import Surface
from ..mesh.triangle_mesh import BoolArray, FloatArray, IntArray
from ..progress import Progress

LEAST_SHARE = 0.01
"""Groups under this share of the area are joined first: they would take the place of a part."""
LEAST_REGION = 0.002
"""Connected regions under this share of the area have no say in the borders."""
CHANGE = 20.0
"""Border length, in units of the square root of the area, that a change of all faces from pose to pose counts as."""
EMPTY = 1e-6
"""Area that a component without any counts as."""

BEST_WITHIN, MOST_SEGMENTS = 0.06, 16
"""The number of segments, where it is left open: the most, up to this many, that are nearly as certain as any."""
MOST_CUT = 10.0
"""Border by area, on average over groups, above which these are pieces of what people see as one."""


@dataclass(frozen=True)
class Ground:
    """One pose, on which components lie.

    Attributes
    ----------
    surface : Surface
    adjacency : FaceAdjacency
        Of the m original faces.
    lengths : (p,) array
        Weighted border length between neighbors, for a surface of area 1.
    part : (s, m) int array
        Part of each face as a person would cut this pose, coarse to fine.
    """

    surface: Surface
    adjacency: FaceAdjacency
    lengths: FloatArray
    part: IntArray

    @classmethod
    def of(cls, surface: Surface, tick: Callable[[float], None] | None = None) -> Ground:
        """Find the neighbors, weigh their borders and cut; `tick` is called with the share that is done."""
        original = surface.original
        adjacency = FaceAdjacency.of(surface.welded_faces, original.vertices)
        weights, curvature = border_weights(surface, adjacency, Progress.of_share(tick))
        lengths = weights * adjacency.lengths / np.sqrt(original.area)
        return cls(surface, adjacency, lengths, human_like_parts(surface, adjacency, lengths, curvature))

    def unlike_parts(self, labels: IntArray) -> float:
        """Rand-index error of the connected regions of (m,) labels against the parts, by area (Rand, 1971).

        The mean over coarse and fine parts.
        """
        region = connected_regions(labels, self.adjacency)
        shares = self.surface.original.face_areas / self.surface.original.area
        errors = []
        for part in self.part:
            both = coo_matrix((shares, (region, part))).tocsr()
            both.sum_duplicates()
            each = np.square(np.bincount(region, shares)).sum() + np.square(np.bincount(part, shares)).sum()
            errors.append(each - 2 * np.square(both.data).sum())
        return float(np.mean(errors))


@dataclass(frozen=True)
class Contacts:
    """How the K components of a mixture lie on poses.

    Attributes
    ----------
    borders : (K, K) array
        Weighted border length between two components, for a surface of area 1.
    areas : (K,) array
        Share of the area.
    overlaps : (K, K) array
        Share of the area that both claim: Σ over faces of area times both posteriors.
    """

    borders: FloatArray
    areas: FloatArray
    overlaps: FloatArray

    @classmethod
    def on(cls, ground: Ground, posteriors: FloatArray) -> Contacts:
        """Of one pose, given (m, K) smoothed posteriors of its faces."""
        n_components = posteriors.shape[1]
        original, adjacency = ground.surface.original, ground.adjacency
        graph = FaceGraph(original.face_areas, original.face_centers, adjacency)
        labels, _ = merge_small_regions(posteriors.argmax(axis=1), graph, LEAST_REGION)
        shares = original.face_areas / original.area
        a, b = labels[adjacency.pairs].T
        borders, areas = np.zeros((n_components, n_components)), np.zeros(n_components)
        np.add.at(borders, (a, b), ground.lengths * (a != b))
        np.add.at(areas, labels, shares)
        return cls(borders + borders.T, areas, np.asarray(posteriors.T @ (posteriors * shares[:, None])))

    @classmethod
    def mean(cls, poses: list[Contacts]) -> Contacts:
        """Of several poses, each as much as the others."""
        return cls(*(np.mean([getattr(pose, name) for pose in poses], axis=0) for name in cls.__dataclass_fields__))

    def with_changes(self, posteriors: FloatArray) -> Contacts:
        """With a border, too, between components that take each other's place from pose to pose.

        Given (p, f, K) posteriors of f faces, each as much of the area, in p ≥ 2 poses of one mesh. Or what a pose
        changes would make segments of its own in that pose.
        """
        n_poses, n_faces, n_components = posteriors.shape
        times = np.zeros((n_faces, n_components))
        np.add.at(times, (np.arange(n_faces), posteriors.argmax(axis=2)), 1)
        changes = times.T @ times / (n_faces * n_poses * (n_poses - 1))
        np.fill_diagonal(changes, 0)
        return Contacts(self.borders + CHANGE * changes, self.areas, self.overlaps)


@dataclass(frozen=True)
class Grouping:
    """In which order K components are joined.

    Attributes
    ----------
    pairs : (K − 1, 2) array of int
        The groups that are joined in turn, the larger first, whose name the joined group keeps. A group of one
        component has that one's name.
    certainties : (K,) array
        With 1, 2, … K groups, how sure faces are of their group: Σ over faces of area times the squares of the
        posteriors, which is low where wide borders are long. It foretells how well unseen poses will agree.
    by_chance : (K,) array
        What that would be if only the groups' sizes were known.
    cuts : (K,) array
        Mean over the groups of weighted border length by area, for a surface of area 1.
    """

    pairs: IntArray
    certainties: FloatArray
    by_chance: FloatArray
    cuts: FloatArray

    @classmethod
    def of(cls, contacts: Contacts, scattered: BoolArray | None = None) -> Grouping:
        """Join the components of a mixture, best pair first, until one group is left.

        Those that (K,) `scattered` marks are joined before all others, as the small ones are.
        """
        borders, overlaps = contacts.borders.copy(), contacts.overlaps.copy()
        areas = np.maximum(contacts.areas, EMPTY)
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
            cuts[count - 1 - step] = min(np.mean((borders.sum(axis=1) / areas)[alive]), 1 / EMPTY)
            gain = gains_of_joining(borders, borders.sum(axis=1), areas)
            touch = borders > 0
            small = (np.minimum(areas[:, None], areas) < LEAST_SHARE) | scattered[:, None] | scattered
            # The small before the large, then what touches before what does not; each of these outweighs the rest.
            rank = 4.0 * small + 2.0 * touch + np.where(touch, gain / (1 + np.abs(gain)), overlaps)
            rank[~np.triu(alive[:, None] & alive, 1)] = -np.inf
            i, j = divmod(int(rank.argmax()), count)
            larger, smaller = (i, j) if areas[i] >= areas[j] else (j, i)
            pairs[step] = name[larger], name[smaller]
            name[i] = name[larger]
            for table in (borders, overlaps):
                join_in_table(table, i, j)
            areas[i] += areas[j]
            scattered[i] &= scattered[j]
            scattered[j] = alive[j] = False
        return cls(pairs, certainties, by_chance, cuts)

    def groups(self, n_groups: int) -> IntArray:
        """(K,) group of each component after as many joins as leave `n_groups`.

        Numbered in the order in which the joins would be undone: one group more splits off the last number and leaves
        the others as they are, so that names and colors stay where they were.
        """
        joins = len(self.certainties) - n_groups
        owner = np.arange(len(self.certainties))
        for i, j in self.pairs[:joins]:
            owner[owner == j] = i
        number = np.zeros(len(owner), dtype=np.int64)
        for count, (_, split_off) in enumerate(self.pairs[joins:][::-1], start=1):
            number[split_off] = count
        return np.asarray(number[owner])

    def curve(self) -> FloatArray:
        """(K,) certainty of 1, 2, … K groups beyond chance: 1 where all are sure, 0 where only sizes are known.

        As Cohen's kappa does for agreement, so that numbers of groups can be compared; 0 for one group.
        """
        beyond = 1 - self.by_chance
        return np.asarray((self.certainties - self.by_chance) / np.where(beyond > 0, beyond, 1))

    def best_number(self) -> int:
        """The most groups that are nearly as certain as any; 2 at least, if there are so many components."""
        curve = self.curve()[1:MOST_SEGMENTS]
        if not len(curve):
            return 1
        return 2 + int(np.flatnonzero(curve >= curve.max() - BEST_WITHIN)[-1])

    def number_of_wholes(self, most: int) -> int:
        """The most groups, up to `most`, that are no mere pieces: their borders are short for their areas.

        Fewer groups than these are whole, too.
        """
        pieces = np.flatnonzero(self.cuts[:most] > MOST_CUT)
        return max(int(pieces[0]) if len(pieces) else most, min(most, 2))
