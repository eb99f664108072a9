"""Certainty of each number of segments, for the panel, the terminal and `--json`."""

from __future__ import annotations

from ...core import PoseSegmentation
from ...core.learning.merge_tree import MOST_SEGMENTS
from ...core.message import Message


def certainties(model: PoseSegmentation) -> dict[int, float] | None:
    """Certainty beyond chance by number of segments, for 2, 3, …; None with the paper's setting."""
    if model.grouping_ is None:
        return None
    curve = model.grouping_.curve()[:MOST_SEGMENTS]
    return {number: round(float(share), 3) for number, share in enumerate(curve, start=1) if number > 1}


def certainty_lines(model: PoseSegmentation) -> list[str]:
    """A line that says how certain each number of segments is, if the number was automatic; else none."""
    if model.n_segments != "auto" or model.grouping_ is None:
        return []
    shares = enumerate(model.grouping_.curve()[1:MOST_SEGMENTS], start=2)
    curve = " · ".join(f"{number} {share:.2f}" for number, share in shares)
    return [Message("Certainty by segments: {curve} ({number} taken)", curve=curve, number=model.n_segments_)]


def is_certainty(line: str) -> bool:
    """Whether a line of a model's summary is about certainty."""
    return line.startswith("Certainty")
