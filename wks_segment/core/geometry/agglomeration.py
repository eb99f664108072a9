"""Greedy merging of groups: (r, r) tables with a row and a column for each group, after a merge."""

from __future__ import annotations

from typing import Any

from numpy.typing import NDArray


def merge_in_table(table: NDArray[Any], kept: int, absorbed: int) -> None:
    """Add the row and column of one group of a symmetric table to those of another, in place; the first become 0.

    For a table of truth values, the sum is "or". The diagonal entry becomes a sum of inner entries.
    """
    table[kept] += table[absorbed]
    table[:, kept] += table[:, absorbed]
    table[absorbed] = table[:, absorbed] = 0
