"""The order in which components of a mixture become kinds of parts, and kinds become segments.

Several components describe the signatures inside each kind of part. They are merged first, alike ones before others;
then kinds are merged in the order in which `core/parts` finds them to be one part. So any number of segments, up to the
number of components, needs no learning.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from ..geometry.agglomeration import merge_in_table
from ..mesh.triangle_mesh import FloatArray, IntArray
from ..parts.kinds import Kinds
from .parameters import NSegments

MOST_SEGMENTS = 16
"""If the number of segments is open, it is at most this."""
TWO_PARTS = -1.0
"""Log-odds below which a merge joins what is surely two parts, so that an open number of segments keeps them apart."""
ONE_PART = 0.0
"""Log-odds above which two groups are fragments of what people see as one."""
MOST_LIKENESS = 20.0
"""Log-odds that count for components of one kind; they also bound all others."""


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
    likeness : (K,) array
        With 2, … K groups, log-odds that the two groups that are merged next are one part; the first number is the
        least there can be.
    n_kinds : int
        Number of groups that are kinds of parts: with more groups, kinds are split by signature alone.
    natural : int
        Number of groups if it is open: at least 2, if there are 2 components.
    areas : (K,) array or None
        Share of the area that each component claims on the learned meshes: Σ over faces of area times its posterior.
        None for models of 0.1.0.
    """

    pairs: IntArray
    certainties: FloatArray
    by_chance: FloatArray
    likeness: FloatArray
    n_kinds: int
    natural: int
    areas: FloatArray | None = None

    @classmethod
    def of(
        cls,
        places: FloatArray,
        weights: FloatArray,
        areas: FloatArray,
        kind: IntArray,
        kinds: Kinds,
        overlaps: FloatArray,
        n_kinds: int | None = None,
    ) -> MergeTree:
        """The tree of a mixture.

        Parameters
        ----------
        places : (K, q) array
            Means of the components along axes of about equal weight.
        weights : (K,) array
        areas : (K,) array
            See the attributes.
        kind : (K,) int array
            Kind of part of each component. A kind without any is left out.
        kinds : Kinds
            And the order in which they are merged.
        overlaps : (k, k) array
            Share of the area that two kinds both claim: Σ over faces of area times both posteriors.
        n_kinds : int, optional
            k, if some kinds are not merged because they have no component.
        """
        chief, inside = _merged_inside(places, weights, kind, kinds.count if n_kinds is None else n_kinds)
        between, likeness, table = [], [], overlaps.copy()
        measures = [_certainty(table)]
        for (kept, gone), odds in zip(kinds.merges.tolist(), kinds.likeness.tolist(), strict=True):
            merge_in_table(table, kept, gone)
            if chief[kept] >= 0 and chief[gone] >= 0:
                between.append((chief[kept], chief[gone]))
                likeness.append(float(np.clip(odds, -MOST_LIKENESS, MOST_LIKENESS)))
                measures.append(_certainty(table))
            chief[kept] = chief[kept] if chief[kept] >= 0 else chief[gone]
        # What is measured with each number of groups, the fewest first; splitting kinds further changes nothing.
        certainties, by_chance = np.array(measures[::-1] + measures[:1] * len(inside)).T
        odds = np.array([-MOST_LIKENESS, *likeness[::-1], *[MOST_LIKENESS] * len(inside)])
        natural = max(1 + int(np.count_nonzero(odds[1:MOST_SEGMENTS] < TWO_PARTS)), min(2, len(odds)))
        pairs = np.array(inside + between, dtype=np.int64).reshape(-1, 2)
        return cls(pairs, certainties, by_chance, odds, len(measures), natural, areas)

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

    def group_of_groups(self, fine: int, coarse: int) -> IntArray:
        """(fine,) group that each of `fine` groups belongs to when `coarse` are left."""
        owner = np.zeros(fine, dtype=np.int64)
        owner[self.groups(fine)] = self.groups(coarse)
        return owner

    def without(self, group: int, n_groups: int) -> MergeTree:
        """The tree in which one of `n_groups` groups, not the first, is merged already, and another one split instead.

        For a group that is found nowhere; the tree itself if there is nothing left to split.
        """
        count = len(self.certainties)
        if group == 0 or n_groups >= count:
            return self
        pairs, odds = self.pairs.tolist(), self.likeness[:0:-1].tolist()
        kept, gone = pairs.pop(count - 1 - group)
        likeness = odds.pop(count - 1 - group)
        # Before all other merges of kinds, so that the next group that is lost does not undo this merge; what the group
        # would have taken goes where it goes.
        at = min(count - n_groups - 1, count - self.n_kinds)
        pairs[at:] = [[kept if name == gone else name for name in pair] for pair in pairs[at:]]
        pairs.insert(at, [kept, gone])
        odds.insert(at, likeness)
        likeness_by_number = np.append(self.likeness[0], odds[::-1])
        return replace(self, pairs=np.array(pairs, dtype=np.int64), likeness=likeness_by_number)

    def curve(self) -> FloatArray:
        """(K,) certainty with 1, 2, … K groups beyond chance: 1 if all faces are certain, 0 if only sizes are known.

        Corrected for chance like Cohen's kappa, so that numbers of groups can be compared; 0 for one group.
        """
        beyond = 1 - self.by_chance
        curve = np.asarray((self.certainties - self.by_chance) / np.where(beyond > 0, beyond, 1))
        curve[0] = 0.0  # whatever rounding has left of both numbers
        return curve

    def number_of(self, n_segments: NSegments) -> int:
        """Number of groups for a parameter `n_segments`: itself, or the natural number for "auto"."""
        return self.natural if n_segments == "auto" else n_segments

    def number_of_wholes(self, most: int) -> int:
        """Largest number of groups, up to `most`, that are no fragments of what people see as one.

        With fewer groups than these, all of them are whole as well.
        """
        fragmented = np.flatnonzero(self.likeness[:most] > ONE_PART)
        return max(int(fragmented[0]) if len(fragmented) else most, min(most, 2))


def _merged_inside(
    places: FloatArray, weights: FloatArray, kind: IntArray, n_kinds: int
) -> tuple[IntArray, list[tuple[int, int]]]:
    """Name of the group that the components of each kind end in, −1 for none, and the pairs that are merged to it.

    By Ward (1963).
    """
    weights, chief = weights.copy(), np.full(n_kinds, -1)
    steps: list[tuple[float, tuple[int, int]]] = []
    for k in range(n_kinds):
        names = np.flatnonzero(kind == k).tolist()
        tree: Sequence[FloatArray] = scipy.cluster.hierarchy.linkage(places[names], "ward") if len(names) > 1 else ()
        for first, second, height, _ in tree:
            kept, gone = sorted((names[int(first)], names[int(second)]), key=lambda name: (-weights[name], name))
            weights[kept] += weights[gone]
            names.append(kept)
            steps.append((float(height), (kept, gone)))
        chief[k] = names[-1] if names else -1
    return chief, [pair for _, pair in sorted(steps, key=lambda step: step[0])]


def _certainty(overlaps: FloatArray) -> tuple[float, float]:
    """Certainty of groups with these overlaps, and the certainty by chance."""
    return float(np.trace(overlaps)), float(np.square(overlaps.sum(axis=1)).sum())
