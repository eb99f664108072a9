"""Matching of the regions of a pose with the learned regions, by their traits."""

from __future__ import annotations

import numpy as np
import scipy
from scipy.spatial.distance import cdist

from ..mesh.triangle_mesh import FloatArray, IntArray
from .traits import Traits

IMPOSSIBLE = 1e6
"""Cost of an assignment that is to be avoided: above any sum of differences."""
MATCHING_ROUNDS = 3
"""Maximum number of rounds in which each segment is matched again, given all others."""


def matched(known: Traits, found: Traits, noise: FloatArray) -> IntArray:
    """(r',) index of the known region that each found region is; new regions have numbers from the count of known ones.

    Within each segment, regions are assigned so that the sum of their differences is smallest (Hungarian method): of
    area, mean signature, handedness, and distance to the regions that are already matched. The segment whose assignment
    is clearest comes first.

    Parameters
    ----------
    known, found : Traits
    noise : (4,) array
        Standard deviations of log area, signature, handedness and distance.
    """
    matching = _Matching(known, found, noise)
    open_segments = set(matching.segments)
    while open_segments:
        clearest = max(sorted(open_segments), key=lambda s: _margin(matching.costs(s)))
        matching.assign(clearest)
        open_segments.remove(clearest)
    for _ in range(MATCHING_ROUNDS):
        before = matching.match.copy()
        for segment in matching.segments:
            matching.assign(segment)
        if (matching.match == before).all():
            break
    new = matching.match < 0
    matching.match[new] = len(known.segment) + np.arange(np.count_nonzero(new))
    return matching.match


class _Matching:
    """A matching in progress.

    Attributes
    ----------
    match : (r',) int array
        Known region of each found region, -1 as long as there is none.
    segments : list of int
        Segments that have both known and found regions.
    """

    def __init__(self, known: Traits, found: Traits, noise: FloatArray) -> None:
        self._known, self._found, self._noise = known, found, noise
        self._differences = _differences(known, found, noise)
        self.match = np.full(len(found.segment), -1)
        self.segments = [int(s) for s in np.unique(found.segment) if (known.segment == s).any()]
        self._rows = {s: np.flatnonzero(known.segment == s) for s in self.segments}
        self._columns = {s: np.flatnonzero(found.segment == s) for s in self.segments}

    def costs(self, segment: int) -> FloatArray:
        """Cost of each assignment of a known to a found region of a segment, given the matches of other segments."""
        rows, columns = self._rows[segment], self._columns[segment]
        return np.asarray(self._differences[np.ix_(rows, columns)] + self._displacements(rows, columns))

    def assign(self, segment: int) -> None:
        """Match the regions of a segment at the lowest cost."""
        columns = self._columns[segment]
        best_rows, best_columns = scipy.optimize.linear_sum_assignment(self.costs(segment))
        self.match[columns] = -1
        self.match[columns[best_columns]] = self._rows[segment][best_rows]

    def _displacements(self, rows: IntArray, columns: IntArray) -> FloatArray:
        """(rows, columns) differences of the distances to matched regions outside of `columns`."""
        placed = np.setdiff1d(np.flatnonzero(self.match >= 0), columns)
        if not len(placed):
            return np.zeros((len(rows), len(columns)))
        known, names = self._known, self.match[placed]
        weights = known.area[names] / known.area[names].sum()
        expected, measured = known.distance[np.ix_(rows, names)], self._found.distance[np.ix_(columns, placed)]
        squared = ((expected[:, None] - measured) / self._noise[3]) ** 2 @ weights
        # Distances to several regions say more than one distance, but not as much as independent ones would.
        return np.asarray(np.sqrt(len(placed)) * squared)


def _differences(known: Traits, found: Traits, noise: FloatArray) -> FloatArray:
    """(r, r') differences of each known and each found region in traits of their own, in standard deviations."""
    area, signature, handedness, _ = noise
    areas = np.subtract.outer(np.log(known.area), np.log(found.area)) / area
    signatures = cdist(known.signature / signature, found.signature / signature)
    hands = cdist(known.handedness / handedness, found.handedness / handedness)
    return np.asarray(areas**2 + signatures**2 + hands**2)


def _margin(costs: FloatArray) -> float:
    """Difference in cost between the best assignment and the second best."""
    if min(costs.shape) == 0:
        return np.inf
    rows, columns = scipy.optimize.linear_sum_assignment(costs)
    best = costs[rows, columns].sum()
    alternatives = []
    for i, j in zip(rows, columns, strict=True):
        without = costs.copy()
        without[i, j] = IMPOSSIBLE
        other_rows, other_columns = scipy.optimize.linear_sum_assignment(without)
        alternatives.append(without[other_rows, other_columns].sum())
    return float(min(alternatives) - best)
