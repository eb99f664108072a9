"""What happened: for the status bar, the terminal and `--json`."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np

from ...core import PoseSegmentation
from ...core.mesh.triangle_mesh import IntArray
from ..parts import part_ids
from ..scene.poses import Pose
from .certainty import certainties, certainty_lines


@dataclass
class Report:
    """Poses, what was found on them, seconds, and what the user should know."""

    poses: list[Pose]
    laplacians: list[str] = field(default_factory=list)
    n_segments: int = 0
    parts: dict[str, int] = field(default_factory=dict)
    certainty: dict[int, float] | None = None
    seconds: dict[str, float] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)

    def tell_of(self, model: PoseSegmentation) -> None:
        """Say how many segments a fitted model has, and how certain it is of each number."""
        self.n_segments, self.certainty = model.n_segments_, certainties(model)
        self.notes = certainty_lines(model)

    def tell_of_parts(self, labels: IntArray) -> None:
        """Say which parts there are among labels."""
        occurring = part_ids.unique_parts(labels)
        self.n_segments = len(np.unique(part_ids.segments_of(np.array(occurring))))
        self.parts = {part_ids.default_name(part): part for part in occurring}

    def warn(self, text: str) -> None:
        """Warn of something, once."""
        self.warnings = list(dict.fromkeys([*self.warnings, text]))

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Add the time of a block to a stage."""
        start = time.perf_counter()
        yield
        self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - start

    @property
    def facts(self) -> list[str]:
        """What a person wants to know, short."""
        return [
            "1 pose" if len(self.poses) == 1 else f"{len(self.poses)} poses",
            f"{sum(pose.mesh.n_vertices for pose in self.poses):,} vertices",
            part_ids.count_text(self.n_segments, len(self.parts)),
            *([f"better triangles for {improved}"] if (improved := self.laplacians.count("delaunay")) else []),
            f"{sum(self.seconds.values()):.1f} seconds",
        ]


def segment_warnings(model: PoseSegmentation, report: Report) -> list[str]:
    """What the user should know of the segments that were found."""
    lost = model.n_segments_ - report.n_segments
    return [f"{lost} of {model.n_segments_} segments are gone: all of their parts were too small"] if lost > 0 else []


def pose_warnings(poses: Sequence[Pose], from_frames: bool) -> list[str]:
    """What the user should know of the poses that were learned from."""
    if len(poses) == 1:
        return ["Learned from one pose only: parts are more reliable with three to five"]
    if all(pose.is_like(poses[0]) for pose in poses[1:]):
        hint = "does an animation move the character in these frames?" if from_frames else "pose them differently"
        return [f"All {len(poses)} poses are the same: {hint}"]
    return []
