"""Greedy merging of groups on a surface: what a merge gains, and tables of pairs after a merge.

Used by the normalized cuts of one pose and by the merge tree of mixture components. Both keep (r, r) tables with a row
and a column for each group.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..mesh.triangle_mesh import FloatArray, IntArray


def gains_of_merging(cut: FloatArray, border: FloatArray, area: FloatArray, rows: IntArray | None = None) -> FloatArray:
    """Decrease of the sum over all groups of border length by area, for each pair of groups that could be merged.

    Parameters
    ----------
    cut : (r, r) array
        Weighted border length between two groups.
    border : (r,) array
        Weighted length of the whole border of each group.
    area : (r,) array
    rows : (q,) int array, optional
        Groups for which the gains are computed; all if not given.

    Returns
    -------
    (q, r) array.
    """
    selected = slice(None) if rows is None else rows
    alone = (border / area)[selected, None] + border / area
    merged = (border[selected, None] + border - 2 * cut[selected]) / (area[selected, None] + area)
    return np.asarray(alone - merged)


def merge_in_table(table: NDArray[Any], kept: int, absorbed: int) -> None:
    """Add the row and column of one group of a symmetric table to those of another, in place; the first become 0.

    For a table of truth values, the sum is "or". The diagonal entry becomes a sum of inner entries.
    """
    table[kept] += table[absorbed]
    table[:, kept] += table[:, absorbed]
    table[absorbed] = table[:, absorbed] = 0
