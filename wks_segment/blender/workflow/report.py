"""What a run has done: for the status bar, the terminal and `--json`."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np

from ...core import PoseSegmentation
from ...core.mesh.triangle_mesh import IntArray
from ...core.message import Message
from ..parts import part_ids
from ..scene.characters import Character
from ..scene.poses import Pose
from .certainty import certainties, certainty_lines

TOO_LONG = 50
"""A triangle is suspect if it is this many times as long as the median edge. On 22 characters the longest ones are 26
times as long; on a torn skin they reach through the whole body."""


@dataclass
class Report:
    """Poses, the segments found on them, seconds, and what the user should know.

    Attributes
    ----------
    poses
        The poses that were read.
    laplacians
        For each pose, which triangles its spectrum is computed on.
    n_segments : int
        Segments of the model, or those that occur on the poses, once labeled.
    parts
        Number of each part that occurs, by name.
    certainty
        Certainty by number of segments; None if the model tells none.
    seconds
        Time by stage.
    notes
        Facts to show.
    warnings
        Problems that did not stop the run.
    """

    poses: list[Pose]
    laplacians: list[str] = field(default_factory=list)
    n_segments: int = 0
    parts: dict[str, int] = field(default_factory=dict)
    certainty: dict[int, float] | None = None
    seconds: dict[str, float] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)

    def add_model(self, model: PoseSegmentation) -> None:
        """Record how many segments a fitted model has, and how certain it is of each number."""
        self.n_segments, self.certainty = model.n_segments_, certainties(model)
        self.notes = certainty_lines(model)

    def add_labels(self, labels: IntArray) -> None:
        """Record which parts occur among labels."""
        occurring = part_ids.unique_parts(labels)
        self.n_segments = len(np.unique(part_ids.segments_of(np.array(occurring))))
        self.parts = {part_ids.default_name(part): part for part in occurring}

    def warn(self, *texts: str) -> None:
        """Add warnings, unless they are there already."""
        self.warnings = list(dict.fromkeys([*self.warnings, *texts]))

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Add the time that the block takes to a stage."""
        start = time.perf_counter()
        yield
        self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - start

    @property
    def facts(self) -> list[str]:
        """Short facts for the user: poses, vertices, segments, improved triangles, seconds."""
        improved = self.laplacians.count("delaunay")
        return [
            Message("1 pose") if len(self.poses) == 1 else Message("{count} poses", count=len(self.poses)),
            Message("{count:,} vertices", count=sum(pose.mesh.n_vertices for pose in self.poses)),
            part_ids.count_text(self.n_segments, len(self.parts)),
            *([Message("better triangles for {count}", count=improved)] if improved else []),
            Message("{seconds:.1f} seconds", seconds=sum(self.seconds.values())),
        ]


def segment_warnings(model: PoseSegmentation, report: Report) -> list[str]:
    """Warning that segments of the model do not occur on any pose; none if all occur."""
    lost = model.n_segments_ - report.n_segments
    if lost <= 0:
        return []
    return [
        Message(
            "{lost} of {count} segments are gone: all of their parts were too small", lost=lost, count=model.n_segments_
        )
    ]


def shape_warnings(poses: Sequence[Pose]) -> list[str]:
    """Warnings that triangles of a pose are far too long for its mesh, one for each character."""
    warnings: dict[Character, str] = {}
    for pose in poses:
        corners = pose.mesh.vertices[pose.mesh.faces]
        lengths = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
        count = int(np.count_nonzero(lengths.max(axis=1) > TOO_LONG * np.median(lengths)))
        if count and pose.character not in warnings:
            warnings[pose.character] = Message(
                '"{pose}": {count} triangles are over {times} times as long as most edges: is the skin torn there, '
                "or are there vertices that no bone moves?",
                pose=pose.name, count=count, times=TOO_LONG,
            )  # fmt: skip
    return list(warnings.values())


def pose_warnings(poses: Sequence[Pose], from_frames: bool) -> list[str]:
    """Warnings that the poses to learn from are too few or all the same."""
    if len(poses) == 1:
        return ["Learned from one pose only: segments are more reliable with three to five"]
    if all(pose.is_like(poses[0]) for pose in poses[1:]):
        if from_frames:
            return [
                Message(
                    "All {count} poses are the same: does an animation move the character in these frames?",
                    count=len(poses),
                )
            ]
        return [Message("All {count} poses are the same: pose them differently", count=len(poses))]
    return []
