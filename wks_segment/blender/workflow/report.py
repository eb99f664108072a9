"""What a run has done: for the status bar, the terminal and `--json`."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np

from ... import core
from ...core.mesh.triangle_mesh import IntArray
from ...core.message import Message
from ..parts import part_ids
from ..scene.characters import Character
from ..scene.poses import Pose
from .certainty import certainties, certainty_lines

ONE_POSE = "Learned from one pose only: segments are more reliable with three to five"
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
        Segments of the model; those that it found on the poses, once labeled; those that the list shows, once written.
    n_found : int
        Segments that the model found on the poses, before the user's merges.
    n_merged : int
        Parts among them that are merged into others, because the user did so before.
    parts
        Number of each part that occurs, by name.
    certainty
        Certainty by number of segments; None if the model tells none.
    seconds
        Time by stage.
    choices
        What was chosen when the poses were read: characters, actions.
    curve
        How certain the model is of each number of segments, in lines.
    left_out
        Frames that were left out, with the reason.
    unwrapped
        Objects that were unwrapped, with figures of their UV maps.
    warnings
        Problems that did not stop the run.
    """

    poses: list[Pose]
    laplacians: list[str] = field(default_factory=list)
    n_segments: int = 0
    n_found: int = 0
    n_merged: int = 0
    parts: dict[str, int] = field(default_factory=dict)
    certainty: dict[int, float] | None = None
    seconds: dict[str, float] = field(default_factory=dict)
    choices: list[str] = field(default_factory=list)
    curve: list[str] = field(default_factory=list)
    left_out: list[str] = field(default_factory=list)
    unwrapped: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)

    def add_model(self, model: core.PoseSegmentation) -> None:
        """Record how many segments a fitted model has, and how certain it is of each number."""
        self.n_segments, self.certainty = model.n_segments_, certainties(model)
        self.curve = certainty_lines(model)

    def add_labels(self, labels: IntArray) -> None:
        """Record which parts occur among labels of a model."""
        occurring = part_ids.unique_parts(labels)
        self.add_written({part_ids.default_name(part): part for part in occurring})
        self.n_found = self.n_segments

    def add_written(self, parts: dict[str, int], n_merged: int = 0) -> None:
        """Record the written parts by name, with the user's changes, and how many of the model's are merged."""
        in_order = part_ids.unique_parts(np.array(list(parts.values()), dtype=np.int64))
        self.parts = {name: part for part in in_order for name, number in parts.items() if number == part}
        self.n_segments = len(np.unique(part_ids.segments_of(np.array(in_order))))
        self.n_merged = n_merged

    def warn(self, *texts: str) -> None:
        """Add warnings, unless they are there already."""
        self.warnings = list(dict.fromkeys([*self.warnings, *texts]))

    @property
    def notes(self) -> list[str]:
        """Facts to show."""
        return [*self.choices, *self.curve, *self.unwrapped]

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Add the time that the block takes to a stage."""
        start = time.perf_counter()
        yield
        self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - start

    @property
    def facts(self) -> list[str]:
        """Short facts for the user: poses, vertices, segments, merges, improved triangles, seconds."""
        improved = self.laplacians.count("delaunay")
        return [
            Message("1 pose") if len(self.poses) == 1 else Message("{count} poses", count=len(self.poses)),
            Message("{count:,} vertices", count=sum(pose.mesh.n_vertices for pose in self.poses)),
            part_ids.count_text(self.n_segments, len(self.parts)),
            *merged_facts(self.n_merged),
            *([Message("better triangles for {count}", count=improved)] if improved else []),
            Message("{seconds:.1f} seconds", seconds=sum(self.seconds.values())),
        ]


def merged_facts(count: int) -> list[Message]:
    """Fact that parts are merged into others, which is why there are fewer than the model has; none without merges."""
    if count == 0:
        return []
    return [Message("1 merged into another") if count == 1 else Message("{count} merged into others", count=count)]


def segment_warnings(model: core.PoseSegmentation, report: Report) -> list[str]:
    """Warning that segments of the model do not occur on any pose; none if all occur."""
    lost = model.n_segments_ - report.n_found
    if lost <= 0:
        return []
    return [
        Message(
            "{lost} of {count} segments are gone: all of their regions are below Smallest Part",
            lost=lost, count=model.n_segments_,
        )
    ]  # fmt: skip


def absent_warnings(model: core.PoseSegmentation, report: Report) -> list[str]:
    """Warning that segments of an applied model do not occur on the objects; none if all occur."""
    absent = model.n_segments_ - report.n_found
    if absent <= 0:
        return []
    return [
        Message(
            "{absent} of the model's {count} segments are not on these objects, or are below Smallest Part",
            absent=absent, count=model.n_segments_,
        )
    ]  # fmt: skip


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


def pose_warnings(poses: Sequence[Pose], asked: int | None) -> list[str]:
    """Warnings that the poses to learn from are too few or all the same.

    Parameters
    ----------
    poses
    asked : int or None
        Number of frames of each character that were asked for; None if the poses are not from an animation.
    """
    if asked is None:
        if len(poses) > 1 and all(pose.is_like(poses[0]) for pose in poses[1:]):
            return [Message("All {count} poses are the same: pose them differently", count=len(poses))]
        return [ONE_POSE] if len(poses) == 1 else []
    warnings: list[str] = []
    by_character: dict[str, list[Pose]] = {}
    for pose in poses:
        by_character.setdefault(pose.character.name, []).append(pose)
    for name, own in by_character.items():
        different = sum(not any(pose.is_like(other) for other in own[:i]) for i, pose in enumerate(own))
        if different == 1 < len(own):
            warnings.append(_all_the_same(name, len(own), alone=len(by_character) == 1))
        elif different < asked:
            warnings.append(
                Message(
                    '"{name}": number of different poses is {different}, not {asked}: its animation has no more in '
                    "these frames",
                    name=name, different=different, asked=asked,
                )
            )  # fmt: skip
    return [*warnings, ONE_POSE] if len(poses) == 1 else warnings


def _all_the_same(name: str, count: int, alone: bool) -> Message:
    """Warning that a character does not move; with its name if there are others."""
    if alone:
        return Message(
            "All {count} poses are the same: does an animation move the character in these frames?", count=count
        )
    return Message(
        'All {count} poses of "{name}" are the same: does an animation move it in these frames?', count=count, name=name
    )
