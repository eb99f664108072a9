"""The job of *Update Segments*: labels of several characters, each by its own model, with the current settings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ... import core
from ...core.progress import Progress
from ..scene.poses import Pose
from .segmentation_job import SegmentationJob


@dataclass(frozen=True)
class UpdateJob:
    """Jobs that are computed and written together."""

    jobs: Sequence[SegmentationJob]

    @property
    def poses(self) -> list[Pose]:
        """Poses that signatures are needed of."""
        return [pose for job in self.jobs for pose in job.poses]

    @property
    def model(self) -> core.PoseSegmentation:
        """The model whose signature takes the most time and memory."""
        return max((job.model for job in self.jobs), key=lambda model: model.n_eigenpairs)

    @property
    def guard(self) -> UpdateJob:
        """What says whether the scene has changed."""
        return self

    def check_quickly(self) -> None:
        """Raise ChangedError if a mesh of a job has changed, as far as can be seen without reading it."""
        for job in self.jobs:
            job.guard.check_quickly()

    def compute(self, progress: Progress) -> None:
        """Compute all labels; touches nothing of Blender."""
        for job, part in progress.each(self.jobs):
            job.compute(part)
