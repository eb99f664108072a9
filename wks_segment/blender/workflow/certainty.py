"""Certainty of each number of segments, for the panel, the terminal and `--json`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ... import core
from ...core.message import Message

if TYPE_CHECKING:
    from ...core.learning.merge_tree import MergeTree


def certainties(model: core.PoseSegmentation) -> dict[int, float] | None:
    """Certainty beyond chance by number of segments, for 2, 3, …; None with the paper's setting."""
    if model.grouping_ is None:
        return None
    return {number: round(share, 3) for number, share in _curve(model.grouping_)}


def certainty_lines(model: core.PoseSegmentation) -> list[str]:
    """A line that says how certain each number of segments is, if the number was automatic; else none."""
    if model.n_segments != "auto" or model.grouping_ is None:
        return []
    curve = " · ".join(f"{number} {share:.2f}" for number, share in _curve(model.grouping_))
    return [Message("Certainty by segments: {curve} ({number} taken)", curve=curve, number=model.n_segments_)]


def _curve(grouping: MergeTree) -> list[tuple[int, float]]:
    """Numbers of segments, 2, 3, …, with their certainty beyond chance."""
    from ...core.learning.merge_tree import MOST_SEGMENTS

    return list(enumerate(grouping.curve()[1:MOST_SEGMENTS].tolist(), start=2))


def is_certainty(line: str) -> bool:
    """Whether a line of a model's summary is about certainty."""
    return line.startswith("Certainty")
