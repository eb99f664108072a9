"""Learn and Segment and Apply to Selected in three steps: read, compute without Blender, write."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from typing import Literal

import bpy

from ...core import Cache, PoseSegmentation, Workpiece
from ...core.mesh.triangle_mesh import FloatArray, IntArray
from ...core.message import Message, message_of
from ...core.progress import Progress
from ..errors import UserError
from ..props.settings import WKSSegmentSettings
from ..scene import poses as reader
from ..scene.change_guard import ChangeGuard
from ..scene.characters import Character, evaluated_objects, group, mesh_objects, quoted, selected_meshes
from ..scene.pose_sources import read_training_poses
from ..scene.poses import Pose
from ..scene.simulations import check_simulations
from . import describing, model_library, pipeline
from .describing import Run
from .pipeline import LabelRequest
from .report import Report, pose_warnings, segment_warnings, shape_warnings

LEARN_SHARE = 0.97
"""Share of the progress of a job that learns before labeling: what takes long is known from learning."""
SOFT_SHARE = 0.3
"""Share of soft weights in the progress of labeling."""


@dataclass
class SegmentationJob:
    """A job that labels meshes by a model, and learns the model first if asked to.

    Everything that it needs of Blender is read when it is made; `compute` works on arrays only, and `write` brings the
    result back.

    Attributes
    ----------
    model : PoseSegmentation
        Unfitted if the job learns, else fitted.
    poses
        Meshes to learn from, or to apply the model to.
    request : LabelRequest
        Settings of the labels.
    guard : ChangeGuard
        Tells whether the scene is still as it was read.
    report : Report
    learns : bool
        Whether the model is learned from the poses, and stored in the scene.
    number : int or "auto"
        Number of segments in the settings when the job was read.
    cache : Cache
        Signatures computed earlier; new ones are added.
    described
        The described poses, once computed.
    first : SegmentationJob, optional
        The job that this one repeats with other settings.
    labels
        The part of each polygon of each character, once computed.
    """

    model: PoseSegmentation
    poses: list[Pose]
    request: LabelRequest
    guard: ChangeGuard
    report: Report
    learns: bool
    number: int | Literal["auto"]
    cache: Cache
    described: list[Workpiece] = field(default_factory=list)
    first: SegmentationJob | None = None
    labels: dict[Character, IntArray] = field(default_factory=dict)
    _weights: dict[Character, dict[int, FloatArray]] | None = None

    @classmethod
    def learning(cls, context: bpy.types.Context, cache: Cache) -> SegmentationJob:
        """Read poses and settings to learn from; UserError if they cannot be used."""
        settings, report = context.scene.wks_segment, Report([])
        with report.stage("read"):
            report.poses = read_training_poses(context, settings, report)
        asked = {"FRAMES": settings.pose_count - len(report.left_out), "MARKERS": 1}.get(settings.source)
        report.warn(*report.left_out, *pose_warnings(report.poses, asked))
        return cls._read(context, settings.new_model(), report, cache, learns=True)

    @classmethod
    def applying(
        cls, context: bpy.types.Context, cache: Cache, model: PoseSegmentation | None = None,
        objects: Sequence[bpy.types.Object] = (),
    ) -> SegmentationJob:  # fmt: skip
        """Read objects to apply a model to: the selected ones and the model in use if none are given.

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
            evaluated = evaluated_objects(context.view_layer)
            disabled = [obj.name for obj in chosen if obj not in evaluated]
            if disabled:
                raise UserError(
                    "{names} is disabled in viewports, or its collection is disabled or excluded: enable it first",
                    names=quoted(disabled),
                )
            characters = group(chosen, together=settings.one_character)
            check_simulations(context.scene, characters, over_time=False)
            report.poses = reader.read_objects(context, characters)
        return cls._read(context, model, report, cache, learns=False)

    @classmethod
    def _read(
        cls, context: bpy.types.Context, model: PoseSegmentation, report: Report, cache: Cache, learns: bool
    ) -> SegmentationJob:
        settings, poses = context.scene.wks_segment, report.poses
        report.warn(*shape_warnings(poses))
        with report.stage("read"):
            characters = [pose.character for pose in poses]
            request, guard = LabelRequest.of(settings, characters), ChangeGuard(context.scene, characters)
        return cls(model, poses, request, guard, report, learns, settings.number(), cache)

    def with_settings(self, settings: WKSSegmentSettings) -> SegmentationJob:
        """The same poses and model with other settings, so that only labels need to be computed.

        Raises
        ------
        UserError
            If the settings need another model, or the scene has changed.
        """
        first, number = self.first or self, settings.number()
        first.guard.check_quickly()
        report = Report(first.poses, first.report.laplacians)
        model = copy(first.model)
        model.smoothness = settings.smoothness
        if number != first.number:
            # Regions are learned anew only where sides need them; labels of one part for both sides do not.
            described = first.described if first.learns and settings.sides == "two" else []
            try:
                with report.stage("regroup"):
                    model = model.with_segments(number, described, first.poses[0].upright)
            except ValueError as error:
                raise UserError(
                    "This number of segments needs a new Learn and Segment: {reason}", reason=message_of(error)
                ) from error
        with report.stage("read"):
            request = LabelRequest.of(settings, [pose.character for pose in first.poses])
        return replace(first, model=model, request=request, report=report, first=first, labels={}, _weights=None)

    def compute(self, progress: Progress) -> None:
        """Describe the poses, learn from them if asked to, and label them; UserError if the core refuses.

        Touches nothing of Blender, so that a thread can run it.
        """
        with_described = progress
        if not self.described:
            with_described = self._describe(progress)
        labeled = 1.0 - SOFT_SHARE if self.request.outputs.vertex_groups == "soft" else 1.0
        run = Run(self.report, with_described.part(0.0, labeled))
        self.labels = pipeline.label(self.model, self.poses, self.described, self.request, run)
        run = Run(self.report, with_described.part(labeled, 1.0))
        self._weights = pipeline.soften(self.model, self.poses, self.described, self.labels, self.request, run)
        if self.learns:
            self.report.warnings += segment_warnings(self.model, self.report)

    def _describe(self, progress: Progress) -> Progress:
        """Describe the poses, and learn from them if asked to; the progress of the rest."""
        run = Run(self.report, progress, self.cache)
        if self.learns:
            run = run.with_progress(progress.part(0.0, LEARN_SHARE))
            self.described = pipeline.learn(self.model, self.poses, run)
            return progress.part(LEARN_SHARE, 1.0)
        self.described, rest = describing.describe_to_label(self.model, self.poses, run)
        return rest

    def write(self, follows: bool = False) -> None:
        """Write the labels, and the model if it was learned; ChangedError, and nothing written, if the scene changed.

        Parameters
        ----------
        follows : bool
            Whether the labels in the scene are from the same job, with other settings.
        """
        self.guard.check_fully()
        settings = self.guard.scene().wks_segment
        # With another number of segments, or another model, a part can get another number.
        renumbered = self.learns or self.first is not None
        # A row is added for a new job, and for a repeated one whose row was undone.
        adds = self.learns and not (self.first is not None and follows) and not settings.replace_model
        if adds:
            # Names and colors belong to the other model, and are stored before they are carried over to this one.
            model_library.store_active(settings)
        pipeline.write_outputs(settings, self.labels, self.request, self.report, self._weights, renumbered)
        if self.learns:
            names = list(dict.fromkeys(pose.character.name for pose in self.poses))
            first_names = ", ".join(names[:3])
            origin = Message("From {names}", names=first_names + " …" * (len(names) > 3))
            lines = [origin, *self.report.facts[:3], *self.report.choices]
            model_library.keep(settings, self.model, lines, first_names, adds)
        elif self.first is not None:
            # The model is stored with this number of segments, so that applying it again gives the same ones.
            lines = [model_library.summary_of(settings)[0], Message("{count} segments", count=self.model.n_segments_)]
            model_library.keep(settings, self.model, lines)
