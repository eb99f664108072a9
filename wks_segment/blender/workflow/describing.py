"""Describes poses by their signatures, which takes most of the time of a job; without Blender, so in any thread."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from ... import core
from ...core.mesh.triangle_mesh import IntArray
from ...core.message import Message, message_of
from ...core.progress import Progress
from ..errors import UserError
from ..scene.poses import Pose
from .report import Report

if TYPE_CHECKING:
    from ...core.poses.describe import Duration


CONNECTED_TO_LEARN, CONNECTED_TO_LABEL = 0.02, 0.08
"""Share of the time of a job after which the poses are connected, if signatures are new: means of five characters."""


@dataclass(frozen=True)
class Run:
    """What a computation reports to, and what it may use.

    Attributes
    ----------
    report : Report
        Collects facts and warnings.
    progress : Progress
        Told how far the computation is; can end it.
    cache : optional
        Signatures computed earlier; new ones are added.
    workers : int, optional
        Threads that describe poses at the same time, see `PoseSegmentation.describe_all`.
    on_draft : callable, optional
        Called with a draft of the labels, by `pipeline.learn` if it takes so long that somebody would look at it.
    """

    report: Report
    progress: Progress = field(default_factory=Progress)
    cache: core.Cache | None = None
    workers: int | None = None
    on_draft: Callable[[list[IntArray]], None] | None = None

    def with_progress(self, progress: Progress) -> Run:
        """The same with another progress, usually a part of this one."""
        return replace(self, progress=progress)


@dataclass(frozen=True)
class Prepared:
    """Poses that are about to be described.

    Attributes
    ----------
    originals : list of int
        For each pose the first one that is equal to it, which alone is described.
    connections
        How the mesh of each original is connected.
    known
        The signature of each original, None if it must be computed.
    """

    originals: list[int]
    connections: dict[int, core.Connection]
    known: dict[int, core.PoseSignature | None]

    def describing_share(self, model: core.PoseSegmentation, poses: Sequence[Pose], rest: Duration) -> float:
        """Share of the time of a job that is spent on signatures; see `PoseDescriber.describing_share`."""
        return model.describing_share(self._new(poses), len(self.known), rest)

    def seconds(self, model: core.PoseSegmentation, poses: Sequence[Pose], rest: Duration) -> float:
        """Estimate of the seconds of a processor that a job takes; 0 if all signatures are known."""
        share = self.describing_share(model, poses, rest)
        return model.describing_seconds(self._new(poses)) / share if share > 0 else 0.0

    def _new(self, poses: Sequence[Pose]) -> list[core.TriangleMesh]:
        return [poses[i].mesh for i, signature in self.known.items() if signature is None]


def prepare(model: core.PoseSegmentation, poses: Sequence[Pose], run: Run) -> Prepared:
    """Connect poses, and find the signatures that are known; UserError if the core refuses a pose."""
    originals = [next((j for j in range(i) if pose.is_like(poses[j])), i) for i, pose in enumerate(poses)]
    distinct = list(dict.fromkeys(originals))
    with run.report.stage("connect"):
        connections = _connections(model, poses, run.progress)
    with run.report.stage("signature"):
        known = model.known_signatures([poses[i].mesh for i in distinct], [connections[i] for i in distinct], run.cache)
    return Prepared(originals, {i: connections[i] for i in distinct}, dict(zip(distinct, known, strict=True)))


def describe(
    model: core.PoseSegmentation, poses: Sequence[Pose], run: Run, prepared: Prepared | None = None
) -> list[core.Workpiece]:
    """Describe each pose by its signature, so that it can be labeled.

    Equal poses are described once, and poses in the cache not at all. Raises UserError if the core refuses a pose.
    """
    prepared = prepare(model, poses, run) if prepared is None else prepared
    distinct = list(prepared.known)
    with run.report.stage("signature"), _solver_warnings(run.report):
        try:
            signatures = model.describe_all(
                [poses[i].mesh for i in distinct],
                list(prepared.connections.values()),
                run.progress.titled("Signature of {stage}"),
                [Message('"{pose}"', pose=poses[i].name) for i in distinct],
                workers=run.workers,
                cache=run.cache,
                known=list(prepared.known.values()),
            )
        except (ValueError, core.SpectrumError, MemoryError) as error:
            raise UserError(message_of(error)) from error
    described = dict(zip(distinct, map(core.Workpiece, signatures), strict=True))
    run.report.laplacians = [described[original].pose.laplacian for original in prepared.originals]
    return [described[original] for original in prepared.originals]


def describe_to_label(
    model: core.PoseSegmentation, poses: Sequence[Pose], run: Run
) -> tuple[list[core.Workpiece], Progress]:
    """`describe` for a job that labels the poses next, and the progress that is left for that."""
    from ...core.poses.describe import LABELING

    prepared = prepare(model, poses, run)
    share = prepared.describing_share(model, poses, LABELING)
    progress = run.progress.part(CONNECTED_TO_LABEL, 1.0) if share > 0 else run.progress
    described = describe(model, poses, run.with_progress(progress.part(0.0, share)), prepared)
    return described, progress.part(share, 1.0)


def _connections(model: core.PoseSegmentation, poses: Sequence[Pose], progress: Progress) -> list[core.Connection]:
    """Connection of each pose: one surface in all poses of a mesh, also where islands of it meet in some."""
    connections: list[core.Connection] = []
    for i, pose in enumerate(poses):
        original = next(j for j, other in enumerate(poses) if pose.is_mesh_of(other))
        if original < i:
            connections.append(connections[original])
            continue
        progress(0.0, Message('Connecting "{pose}"', pose=pose.name))
        same_mesh = [other.mesh for other in poses if pose.is_mesh_of(other)]
        try:
            connections.append(core.connect(*same_mesh, rest=pose.rest, pieces=model.pieces))
        except ValueError as error:
            raise UserError('"{pose}": {reason}', pose=pose.name, reason=message_of(error)) from error
    return connections


@contextmanager
def _solver_warnings(report: Report) -> Iterator[None]:
    """Move the eigensolver's warnings in this block to a report, and pass all others on after it."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        yield
    report.warnings += dict.fromkeys(
        message_of(warning.message)
        for warning in caught
        if isinstance(warning.message, Warning) and issubclass(warning.category, core.SpectrumWarning)
    )
    # Other code may have warned meanwhile in Blender's own thread.
    for warning in caught:
        if not issubclass(warning.category, core.SpectrumWarning):
            warnings.warn_explicit(warning.message, warning.category, warning.filename, warning.lineno)
