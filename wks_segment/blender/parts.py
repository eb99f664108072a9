"""Parts as they are written: a segment's number, or that of its left or right part; their names and order.

Where left and right are one, part c is segment c. Where they are two, those in the middle keep that number, those on
the left are c + 1000, and those on the right c + 2000.
"""

from __future__ import annotations

import numpy as np

from ..core.mesh import IntArray

SIDE = 1000
"""From the middle to the left, and from there to the right. More than a model has segments, so that a number means the
same whichever model it is from."""
SUFFIXES = ("", ".L", ".R")
"""Blender's convention, by which it mirrors bones and vertex groups."""


def numbered(segments: IntArray, sides: IntArray) -> IntArray:
    """(p,) number of the part of each polygon, −1 for one of no segment; sides are 1 left, −1 right, 0 neither."""
    return np.where(segments < 0, segments, segments + SIDE * (sides % len(SUFFIXES)))


def segments_of(parts: IntArray) -> IntArray:
    """(…) segment that each part is of."""
    return parts % SIDE


def sides_of(parts: IntArray) -> IntArray:
    """(…) 0 for each part in the middle, 1 for one on the left, 2 for one on the right."""
    return parts // SIDE


def among(parts: IntArray) -> list[int]:
    """The different parts that occur, by segment, in each the middle one, the left one, the right one."""
    found = np.unique(parts)
    in_order: list[int] = found[np.lexsort((sides_of(found), segments_of(found)))].tolist()
    return in_order


def counted(n_segments: int, n_parts: int) -> str:
    """How many segments, and how many parts if these are more."""
    return f"{n_segments} segments" + f" in {n_parts} parts" * (n_parts > n_segments)


def name_of(part: int) -> str:
    """As a person reads it: Segment 3, or Segment 3.L and Segment 3.R."""
    return f"Segment {part % SIDE + 1}{SUFFIXES[part // SIDE]}"
