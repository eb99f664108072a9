"""Numbers of parts, their names and their order.

Without sides, the part of segment c has the number c. With sides, the part in the middle has the number c, the one on
the left c + 1000, and the one on the right c + 2000. Parts that a person made, by splitting a part or from selected
faces, are numbered in the same way, with c of 500 or more.
"""

from __future__ import annotations

from collections.abc import Collection
from itertools import count

import numpy as np

from ...core.mesh.triangle_mesh import IntArray
from ...core.message import Message

SIDE_STEP = 1000
"""Difference from the number in the middle to the number on the left, and from that to the right. Models have fewer
segments than this, so that a number means the same with every model."""
FIRST_MADE = 500
"""Lowest segment number of a part that a person made. The settings allow fewer segments than this; if a model file has
more, the next free number is taken."""
SIDE_SUFFIXES = ("", ".L", ".R")
"""Suffixes of names by side: Blender's convention, by which it mirrors bones and vertex groups."""


def from_segments(segments: IntArray, sides: IntArray) -> IntArray:
    """(p,) part of each polygon, given its segment (−1 for none) and its side (1 left, −1 right, 0 neither)."""
    # The core has 1, −1 and 0 for left, right and neither; the numbers of parts have 1, 2 and 0: −1 % 3 is 2.
    return np.where(segments < 0, segments, segments + SIDE_STEP * (sides % len(SIDE_SUFFIXES)))


def segments_of(parts: IntArray) -> IntArray:
    """(…) segment of each part."""
    return parts % SIDE_STEP


def sides_of(parts: IntArray) -> IntArray:
    """(…) side of each part: 0 for the middle, 1 for left, 2 for right."""
    return parts // SIDE_STEP


def unique_parts(parts: IntArray) -> list[int]:
    """The distinct parts that occur, in order of their segments, and of middle, left and right in a segment."""
    distinct = np.unique(parts)
    ordered: list[int] = distinct[np.lexsort((sides_of(distinct), segments_of(distinct)))].tolist()
    return ordered


def count_text(n_segments: int, n_parts: int) -> Message:
    """Text with the number of segments, and the number of parts if there are more of them."""
    if n_parts > n_segments:
        return Message("{segments} segments in {parts} parts", segments=n_segments, parts=n_parts)
    return Message("{count} segments", count=n_segments)


def default_name(part: int) -> str:
    """Name of a part that a person has not renamed: Segment 3, or Segment 3.L and Segment 3.R with sides."""
    return f"Segment {part % SIDE_STEP + 1}{SIDE_SUFFIXES[part // SIDE_STEP]}"


def without_side(name: str) -> str:
    """Name of a part without the suffix of its side."""
    return name[:-2] if name.endswith(SIDE_SUFFIXES[1:]) else name


def siblings_of(part: int) -> list[int]:
    """The parts that share a name except for its suffix: a model's part on the left and the same part on the right.

    A part in the middle or made by hand has no sibling: only the part itself is returned.
    """
    segment, side = part % SIDE_STEP, part // SIDE_STEP
    return [part] if side == 0 or segment >= FIRST_MADE else [segment + SIDE_STEP, segment + 2 * SIDE_STEP]


def model_of(labels: str) -> str:
    """Identity of the model of a label set, given its key; empty if no model gave the labels."""
    return labels.rpartition("/")[0]


def number_of(labels: str) -> int:
    """Number of segments of a label set, given its key; 0 if it is not known."""
    number = labels.rpartition("/")[2]
    return int(number) if number.isdecimal() else 0


def free_part(taken: Collection[int], side: int = 0) -> int:
    """Number for a new part that a person makes, of a segment that no taken part has."""
    segments = {part % SIDE_STEP for part in taken}
    return next(segment for segment in count(FIRST_MADE) if segment not in segments) + side * SIDE_STEP
