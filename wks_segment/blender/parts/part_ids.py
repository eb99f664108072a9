"""Parts as they are written: a segment's number, or that of its left or right part; their names and order.

Where left and right are one, part c is segment c. Where they are two, those in the middle keep that number, those on
the left are c + 1000, and those on the right c + 2000. Parts that a person made (by splitting one, or out of chosen
faces) are numbered likewise, with c from 500 on.
"""

from __future__ import annotations

from collections.abc import Collection
from itertools import count

import numpy as np

from ...core.mesh.triangle_mesh import IntArray
from ...core.message import Message

SIDE_STEP = 1000
"""From the middle to the left, and from there to the right. More than a model has segments, so that a number means the
same whichever model it is from."""
FIRST_MADE = 500
"""The first segment that is none of a model's. A model with more than the settings allow can have it: then the next."""
SIDE_SUFFIXES = ("", ".L", ".R")
"""Blender's convention, by which it mirrors bones and vertex groups."""


def from_segments(segments: IntArray, sides: IntArray) -> IntArray:
    """(p,) number of the part of each polygon, −1 for one of no segment; sides are 1 left, −1 right, 0 neither."""
    return np.where(segments < 0, segments, segments + SIDE_STEP * (sides % len(SIDE_SUFFIXES)))


def segments_of(parts: IntArray) -> IntArray:
    """(…) segment that each part is of."""
    return parts % SIDE_STEP


def sides_of(parts: IntArray) -> IntArray:
    """(…) 0 for each part in the middle, 1 for one on the left, 2 for one on the right."""
    return parts // SIDE_STEP


def unique_parts(parts: IntArray) -> list[int]:
    """The different parts that occur, by segment, in each the middle one, the left one, the right one."""
    found = np.unique(parts)
    in_order: list[int] = found[np.lexsort((sides_of(found), segments_of(found)))].tolist()
    return in_order


def count_text(n_segments: int, n_parts: int) -> Message:
    """How many segments, and how many parts if these are more."""
    if n_parts > n_segments:
        return Message("{segments} segments in {parts} parts", segments=n_segments, parts=n_parts)
    return Message("{count} segments", count=n_segments)


def default_name(part: int) -> str:
    """As a person reads it: Segment 3, or Segment 3.L and Segment 3.R."""
    return f"Segment {part % SIDE_STEP + 1}{SIDE_SUFFIXES[part // SIDE_STEP]}"


def without_side(name: str) -> str:
    """A part's name without the suffix of its side."""
    return name[:-2] if name.endswith(SIDE_SUFFIXES[1:]) else name


def siblings_of(part: int) -> list[int]:
    """The part, and what it is on the other side: a left and a right part are called alike. Made ones are alone."""
    segment, side = part % SIDE_STEP, part // SIDE_STEP
    return [part] if side == 0 or segment >= FIRST_MADE else [segment + SIDE_STEP, segment + 2 * SIDE_STEP]


def free_part(taken: Collection[int], side: int = 0) -> int:
    """The number of a part to be made, of a segment that none of the taken parts is of."""
    segments = {part % SIDE_STEP for part in taken}
    return next(segment for segment in count(FIRST_MADE) if segment not in segments) + side * SIDE_STEP
