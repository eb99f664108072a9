"""What Learn and Segment and Apply to Selected do, in three steps: read, compute without Blender, write."""

from __future__ import annotations

from dataclasses import dataclass, field

import bpy

from ..core import PoseSegmentation
from ..core.description import Progress
from ..core.mesh import FloatArray, IntArray
from . import poses as reader
from . import tasks
from .characters import Character, group, mesh_objects
from .poses import Pose
from .report import Report, segment_warnings
from .tasks import Wanted
from .training import read_training_poses
from .watch import Watch

LEARNED, DESCRIBED = 0.9, 0.6
"""Share of the work that is done when labelling begins: in learning, and in applying."""
LABELLED = 0.7
"""Share of the rest that is labelling, not soft weights."""


@dataclass
class Work:
    """One job: made of what was read, and then nothing but arrays until it is written.

    Attributes
    ----------
    model : PoseSegmentation
        To be fitted if the work is learning, else fitted.
    poses
    wanted : Wanted
    watch : Watch
        Tells whether the scene is still as it was read.
    report : Report
    learns : bool
        Whether the model is learned from the poses, and kept in the scene.
    """

    model: PoseSegmentation
    poses: list[Pose]
    wanted: Wanted
    watch: Watch
    report: Report
    learns: bool
    _labels: dict[Character, IntArray] = field(default_factory=dict)
    _soft: dict[Character, dict[int, FloatArray]] | None = None

    @classmethod
    def learning(cls, context: bpy.types.Context) -> Work:
        """Read poses and settings to learn from; UserError if they cannot be used."""
        report = Report([])
        poses = read_training_poses(context, context.scene.wks_segment, report)
        return cls._read(context, context.scene.wks_segment.new_model(), poses, report, learns=True)

    @classmethod
    def applying(cls, context: bpy.types.Context) -> Work:
        """Read the selected objects to apply the scene's model to them; UserError if they cannot be used."""
        settings, report = context.scene.wks_segment, Report([])
        model = tasks.stored_model(settings)
        model.smoothness = settings.smoothness
        with report.stage("read"):
            report.poses = reader.read_objects(context, group(mesh_objects(context.selected_objects)))
        return cls._read(context, model, report.poses, report, learns=False)

    @classmethod
    def _read(
        cls, context: bpy.types.Context, model: PoseSegmentation, poses: list[Pose], report: Report, learns: bool
    ) -> Work:
        with report.stage("read"):
            characters = [pose.character for pose in poses]
            wanted, watch = Wanted.of(context.scene.wks_segment, characters), Watch(context.scene, characters)
        return cls(model, poses, wanted, watch, report, learns)

    def compute(self, progress: Progress) -> None:
        """Describe, learn if that is the work, label; UserError if the core refuses. Fit for a thread."""
        begun = LEARNED if self.learns else DESCRIBED

        def describing(stage: str, share: float) -> None:
            progress(stage, begun * share)

        def labelling(stage: str, share: float) -> None:
            progress(stage, begun + (1 - begun) * LABELLED * share)

        def softening(stage: str, share: float) -> None:
            progress(stage, begun + (1 - begun) * (LABELLED + (1 - LABELLED) * share))

        model, poses, wanted, report = self.model, self.poses, self.wanted, self.report
        step = tasks.learn if self.learns else tasks.describe
        described = step(model, poses, report, describing)
        self._labels = tasks.label(model, poses, described, wanted, report, labelling)
        self._soft = tasks.soften(model, poses, described, self._labels, wanted, report, softening)
        if self.learns:
            report.warnings += segment_warnings(model, report)

    def write(self) -> None:
        """Write labels, and a learned model; ChangedError, and nothing written, if what was read has changed."""
        self.watch.look()
        tasks.write(self._labels, self.wanted, self.report, self._soft)
        if self.learns:
            names = list(dict.fromkeys(pose.character.name for pose in self.poses))
            origin = f"From {', '.join(names[:3])}{' …' * (len(names) > 3)}"
            self.watch.scene().wks_segment.keep_model(self.model, [origin, *self.report.facts[:3]])
