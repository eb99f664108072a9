"""How certain a model is of each number of segments, for the panel, the terminal and `--json`."""

from __future__ import annotations

from ...core import PoseSegmentation
from ...core.learning.merge_tree import MOST_SEGMENTS


def certainties(model: PoseSegmentation) -> dict[int, float] | None:
    """Certainty beyond chance of 2, 3, … segments, the numbers to choose from; None with the paper's setting."""
    if model.grouping_ is None:
        return None
    curve = model.grouping_.curve()[:MOST_SEGMENTS]
    return {number: round(float(share), 3) for number, share in enumerate(curve, start=1) if number > 1}


def certainty_lines(model: PoseSegmentation) -> list[str]:
    """A line on why there are as many segments as there are, if their number was left open."""
    found = certainties(model)
    if model.n_segments != "auto" or not found:
        return []
    each = " · ".join(f"{number} {share:.2f}" for number, share in found.items())
    return [f"Certainty by segments: {each} ({model.n_segments_} taken)"]
