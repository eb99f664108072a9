"""What Learn and Segment and Apply to Selected do, in three steps: read, compute without Blender, write."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from typing import Literal

import bpy

from ...core import Cache, PoseSegmentation, Workpiece
from ...core.mesh.triangle_mesh import FloatArray, IntArray
from ...core.poses.describe import Progress
from ..errors import UserError
from ..props.settings import WKSSegmentSettings
from ..scene import poses as reader
from ..scene.change_guard import Watch
from ..scene.characters import Character, group, mesh_objects, selected_meshes
from ..scene.pose_sources import read_training_poses
from ..scene.poses import Pose
from . import model_library, pipeline
from .live_session import session_of
from .pipeline import Wanted
from .report import Report, pose_warnings, segment_warnings

LEARNED, DESCRIBED = 0.9, 0.6
"""Share of the work that is done when labeling begins: in learning, and in applying."""
LABELED = 0.7
"""Share of the rest that is labeling, not soft weights."""


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
    number : int or "auto"
        Segments that the settings asked for when the model was there.
    cache : Cache
        Asked for signatures, and told of new ones.
    described
        What is known of each pose, once it was computed.
    first : Work, optional
        What this one is a change of.
    labels
        The part of each polygon of each character, once it was computed.
    """

    model: PoseSegmentation
    poses: list[Pose]
    wanted: Wanted
    watch: Watch
    report: Report
    learns: bool
    number: int | Literal["auto"]
    cache: Cache
    described: list[Workpiece] = field(default_factory=list)
    first: Work | None = None
    labels: dict[Character, IntArray] = field(default_factory=dict)
    _soft: dict[Character, dict[int, FloatArray]] | None = None

    @classmethod
    def learning(cls, context: bpy.types.Context) -> Work:
        """Read poses and settings to learn from; UserError if they cannot be used."""
        settings, report = context.scene.wks_segment, Report([])
        with report.stage("read"):
            report.poses = read_training_poses(context, settings)
        report.warnings += pose_warnings(report.poses, settings.source in ("FRAMES", "MARKERS"))
        return cls._read(context, settings.new_model(), report.poses, report, learns=True)

    @classmethod
    def applying(
        cls, context: bpy.types.Context, model: PoseSegmentation | None = None,
        objects: Sequence[bpy.types.Object] = (),
    ) -> Work:  # fmt: skip
        """Read objects to apply a model to them: the selected ones and the model in use if none are given.

        Raises
        ------
        UserError
            If they cannot be used.
        """
        settings, report = context.scene.wks_segment, Report([])
        model = pipeline.stored_model(settings) if model is None else model
        model.smoothness = settings.smoothness
        with report.stage("read"):
            chosen = mesh_objects(objects) if objects else selected_meshes(context)
            report.poses = reader.read_objects(context, group(chosen))
        return cls._read(context, model, report.poses, report, learns=False)

    @classmethod
    def _read(
        cls, context: bpy.types.Context, model: PoseSegmentation, poses: list[Pose], report: Report, learns: bool
    ) -> Work:
        with report.stage("read"):
            characters = [pose.character for pose in poses]
            wanted, watch = Wanted.of(context.scene.wks_segment, characters), Watch(context.scene, characters)
        number, cache = context.scene.wks_segment.number(), session_of(context).cache
        return cls(model, poses, wanted, watch, report, learns, number, cache)

    def again(self, settings: WKSSegmentSettings) -> Work:
        """The same poses and model with other settings, so that there are only labels to find.

        Raises
        ------
        UserError
            If this takes another model, or the scene has changed.
        """
        first, number = self.first or self, settings.number()
        first.watch.glance()
        report = Report(first.poses, first.report.laplacians)
        model = copy(first.model)
        model.smoothness = settings.smoothness
        if number != first.number:
            # Without sides nobody asks for regions, and those that were learned will do.
            poses = first.described if first.learns and settings.sides == "two" else []
            try:
                with report.stage("regroup"):
                    model = model.with_segments(number, poses, first.poses[0].upright)
            except ValueError as error:
                raise UserError(f"This number of segments takes a new Learn and Segment: {error}") from error
        with report.stage("read"):
            wanted = Wanted.of(settings, [pose.character for pose in first.poses])
        return replace(first, model=model, wanted=wanted, report=report, first=first, labels={}, _soft=None)

    def compute(self, progress: Progress) -> None:
        """Describe, learn if that is the work, label; UserError if the core refuses. Fit for a thread."""
        begun = LEARNED if self.learns else DESCRIBED

        def describing(stage: str, share: float) -> None:
            progress(stage, begun * share)

        def labeling(stage: str, share: float) -> None:
            progress(stage, begun + (1 - begun) * LABELED * share)

        def softening(stage: str, share: float) -> None:
            progress(stage, begun + (1 - begun) * (LABELED + (1 - LABELED) * share))

        model, poses, wanted, report = self.model, self.poses, self.wanted, self.report
        if not self.described and self.learns:
            self.described = pipeline.learn(model, poses, report, describing, self.cache)
        elif not self.described:
            self.described = pipeline.describe(model, poses, report, describing, cache=self.cache)
        self.labels = pipeline.label(model, poses, self.described, wanted, report, labeling)
        self._soft = pipeline.soften(model, poses, self.described, self.labels, wanted, report, softening)
        if self.learns:
            report.warnings += segment_warnings(model, report)

    def write(self) -> None:
        """Write labels, and a learned model; ChangedError, and nothing written, if what was read has changed."""
        self.watch.look()
        settings = self.watch.scene().wks_segment
        # Another number of segments numbers them otherwise, as another model does.
        renumbered = self.learns or self.first is not None
        # What follows settings is the same model; what is adjusted was undone, and its row with it.
        follows = self.first is not None and session_of(bpy.context).holds(settings.id_data)
        adds = self.learns and not (follows or settings.replace_model)
        if adds:
            model_library.aside(
                settings
            )  # names and colors of now are the other model's, before they follow to this one
        pipeline.write(settings, self.labels, self.wanted, self.report, self._soft, renumbered)
        if self.learns:
            names = list(dict.fromkeys(pose.character.name for pose in self.poses))
            origin = f"From {', '.join(names[:3])}{' …' * (len(names) > 3)}"
            model_library.keep(settings, self.model, [origin, *self.report.facts[:3]], ", ".join(names[:3]), adds)
        elif self.first is not None:
            # Or what is applied next would not have the segments that are seen.
            origin = settings.model_summary.partition("\n")[0]
            model_library.keep(settings, self.model, [origin, f"{self.model.n_segments_} segments"])
