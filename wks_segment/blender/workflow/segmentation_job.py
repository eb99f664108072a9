"""Learn and Segment and Apply to Selected in three steps: read, compute without Blender, write."""

from __future__ import annotations

from collections.abc import Container, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from hashlib import blake2b
from typing import Any, Literal

import bpy

from ... import core
from ...core.mesh.triangle_mesh import FloatArray, IntArray
from ...core.message import Message, message_of
from ...core.progress import Progress
from ..errors import UserError
from ..outputs.origin import Origin, origin_of
from ..parts import part_ids
from ..parts.palette import MAX_COLORS
from ..props.changes import unheard
from ..props.settings import WKSSegmentSettings
from ..scene import poses as reader
from ..scene.change_guard import ChangeGuard
from ..scene.characters import Character, evaluated_objects, group, mesh_objects, quoted, selected_meshes
from ..scene.pose_sources import read_training_poses
from ..scene.poses import Pose
from ..scene.simulations import check_simulations
from . import describing, model_library, pipeline
from .describing import Run
from .followed_settings import values_of
from .model_ranking import NamedModel, fit_warning, models_of
from .pipeline import LabelRequest
from .report import Report, absent_warnings, pose_warnings, segment_warnings, shape_warnings
from .teaching import Lesson, read_lesson, read_lesson_poses

LEARN_SHARE = 0.97
"""Share of the progress of a job that learns before labeling: what takes long is known from learning."""
OTHER_NUMBER = "This number of segments needs a new Learn and Segment: {reason}"
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
    values
        Values of the settings that labels follow, when the job was read.
    uid : str
        Identity of the model in the scene; empty as long as it has none.
    name : str
        Name by which meshes know the job.
    compared
        The applied model, and the others of the scene that might fit better.
    first : SegmentationJob, optional
        The job that this one repeats with other settings.
    labels
        The part of each polygon of each character, once computed.
    lesson : Lesson, optional
        The parts that the model is taught, if it learns named ones.
    drafts : bool
        Whether to begin with a draft, if the job is long and learns.
    draft
        A provisional part of each polygon of each character, once there is one, to be shown and never written.
    """

    model: core.PoseSegmentation
    poses: list[Pose]
    request: LabelRequest
    guard: ChangeGuard
    report: Report
    learns: bool
    number: int | Literal["auto"]
    cache: core.Cache
    values: dict[str, Any] = field(default_factory=dict)
    uid: str = ""
    name: str = ""
    compared: list[NamedModel] = field(default_factory=list)
    described: list[core.Workpiece] = field(default_factory=list)
    first: SegmentationJob | None = None
    labels: dict[Character, IntArray] = field(default_factory=dict)
    lesson: Lesson | None = None
    drafts: bool = False
    draft: dict[Character, IntArray] = field(default_factory=dict)
    _weights: dict[Character, dict[int, FloatArray]] | None = None

    @classmethod
    def learning(cls, context: bpy.types.Context, cache: core.Cache) -> SegmentationJob:
        """Read poses and settings to learn from; UserError if they cannot be used."""
        settings, report = context.scene.wks_segment, Report([])
        with report.stage("read"):
            objects = without_transferred(selected_meshes(context), report)
            report.poses = read_training_poses(context, settings, report, objects)
        asked = {"FRAMES": settings.pose_count - len(report.left_out), "MARKERS": 1}.get(settings.source)
        report.warn(*report.left_out, *pose_warnings(report.poses, asked))
        return cls._read(context, settings.new_model(), report, cache, learns=True)

    @classmethod
    def teaching(cls, context: bpy.types.Context, cache: core.Cache) -> SegmentationJob:
        """Read the parts of the selected characters, and poses to learn them from; UserError if they cannot be used."""
        settings, report = context.scene.wks_segment, Report([])
        with report.stage("read"):
            objects = without_transferred(selected_meshes(context), report)
            report.poses = read_lesson_poses(context, objects, report)
            lesson = read_lesson(settings, report.poses, report)
        report.warn(*report.left_out)
        job = cls._read(context, settings.new_model(), report, cache, learns=True)
        job = replace(job, lesson=lesson)
        return replace(job, name=job.identity())

    @classmethod
    def applying(
        cls, context: bpy.types.Context, cache: core.Cache, model: core.PoseSegmentation | None = None,
        objects: Sequence[bpy.types.Object] = (), uid: str = "", keeps_number: bool = False,
    ) -> SegmentationJob:  # fmt: skip
        """Read objects to apply a model to: the selected ones and the model in use if none are given.

        The model is applied with the number of segments in the settings, unless it keeps its own; `uid` is its
        identity, if it is of the scene.

        Raises
        ------
        UserError
            If they cannot be used.
        """
        settings, report = context.scene.wks_segment, Report([])
        if model is None:
            model, uid = pipeline.stored_model(settings), model_library.used_uid(settings)
        model.smoothness = settings.smoothness
        number = settings.number()
        if not keeps_number and model.taught_ is not None:
            _show_number_of(model, settings, report)
        elif not keeps_number and number not in ("auto", min(model.n_segments_, MAX_COLORS), model.n_segments):
            try:
                model = model.with_segments(number)
            except ValueError as error:
                report.warn(Message(OTHER_NUMBER, reason=message_of(error)))
                with unheard():
                    settings.n_segments = model.n_segments_
        with report.stage("read"):
            chosen = mesh_objects(objects) if objects else without_transferred(selected_meshes(context), report)
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
        job = cls._read(context, model, report, cache, False, uid)
        return replace(job, compared=models_of(settings, uid))

    @classmethod
    def _read(
        cls, context: bpy.types.Context, model: core.PoseSegmentation, report: Report, cache: core.Cache, learns: bool,
        uid: str = "",
    ) -> SegmentationJob:  # fmt: skip
        settings, poses = context.scene.wks_segment, report.poses
        report.warn(*shape_warnings(poses))
        with report.stage("read"):
            characters = [pose.character for pose in poses]
            request, guard = LabelRequest.of(settings, characters), ChangeGuard(context.scene, characters)
        job = cls(model, poses, request, guard, report, learns, settings.number(), cache, values_of(settings), uid)
        return replace(job, name=job.identity())

    def take_number(self) -> None:
        """Count as labeled with the number of segments that the model has, whatever the settings ask for."""
        if self.number != "auto":
            self.number = min(self.model.n_segments_, MAX_COLORS)
            self.values = {**self.values, "n_segments": self.number}

    def identity(self) -> str:
        """A hash of the model and the poses, the same whenever the same is done with the same meshes."""
        model = repr(self.model) if self.learns else self.uid or self.model.to_json()
        digest = blake2b(model.encode(), digest_size=8)
        for pose in self.poses:
            digest.update(repr((pose.name, [member.name for member in pose.character.members])).encode())
            digest.update(pose.mesh.vertices.tobytes())
        if self.lesson is not None:
            digest.update(repr((self.lesson.names, self.lesson.unlabeled)).encode())
            for labels in self.lesson.labels:
                digest.update(labels.tobytes())
        return digest.hexdigest()

    def with_settings(
        self, settings: WKSSegmentSettings, objects: Container[bpy.types.Object] | None = None
    ) -> SegmentationJob:
        """The same poses and model with other settings, so that only labels need to be computed.

        Parameters
        ----------
        settings
        objects
            Only characters with one of these objects are labeled; all of them if not given.

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
        if number != first.number and model.taught_ is not None:
            _show_number_of(model, settings, report)
        elif number != first.number:
            # Regions are learned anew only where sides need them; labels of one part for both sides do not.
            described = first.described if first.learns and settings.sides == "two" else []
            try:
                with report.stage("regroup"):
                    model = model.with_segments(number, described, first.poses[0].upright)
            except ValueError as error:
                raise UserError(OTHER_NUMBER, reason=message_of(error)) from error
        chosen = [
            i for i, pose in enumerate(first.poses)
            if objects is None or any(obj in objects for obj in pose.character.objects)
        ]  # fmt: skip
        report.poses = [first.poses[i] for i in chosen]
        with report.stage("read"):
            request = LabelRequest.of(settings, [pose.character for pose in report.poses])
        return replace(
            first, model=model, poses=report.poses, request=request, report=report, first=first, labels={},
            described=[first.described[i] for i in chosen] if first.described else [], values=values_of(settings),
            uid=self.uid, _weights=None,
        )  # fmt: skip

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
        else:
            self.report.warnings += absent_warnings(self.model, self.report)
            if self.first is None:
                self._compare()

    def _compare(self) -> None:
        """Warn of characters that the model does not fit."""
        for pose, described in zip(self.poses, self.described, strict=True):
            if self.compared:
                warning = fit_warning(self.compared, [described.pose], pose.character.name)
                self.report.warn(*([] if warning is None else [warning]))

    def _describe(self, progress: Progress) -> Progress:
        """Describe the poses, and learn from them if asked to; the progress of the rest."""
        run = Run(self.report, progress, self.cache)
        if self.learns:
            run = replace(
                run, progress=progress.part(0.0, LEARN_SHARE), on_draft=self._keep_draft if self.drafts else None
            )
            self.described = pipeline.learn(self.model, self.poses, run, self.lesson)
            if self.lesson is not None:
                self.take_number()
            return progress.part(LEARN_SHARE, 1.0)
        self.described, rest = describing.describe_to_label(self.model, self.poses, run)
        return rest

    def _keep_draft(self, labels: list[IntArray]) -> None:
        """Keep a draft for Blender's thread, which shows it."""
        of_poses = zip(self.poses, labels, strict=True)
        self.draft = {
            pose.character: pipeline.filled(parts, self.request.bodies[pose.character]) for pose, parts in of_poses
        }

    def write(self) -> None:
        """Write the labels, and a learned model; ChangedError, and nothing written, if the scene changed."""
        self.guard.check_fully()
        settings = self.guard.scene().wks_segment
        labels = self._keep_model(settings)
        origin = Origin(labels, self.values, self.name)
        pipeline.write_outputs(settings, self.labels, self.request, self.report, self._weights, origin)

    def _keep_model(self, settings: WKSSegmentSettings) -> str:
        """Keep the model in the scene; return the key of its label set."""
        # A job that is repeated by Adjust Last Operation learns again, since its model was undone.
        if self.learns and model_library.row_of(settings, self.uid) is None:
            names = list(dict.fromkeys(pose.character.name for pose in self.poses))
            first_names = ", ".join(names[:3])
            origin = Message("From {names}", names=first_names + " …" * (len(names) > 3))
            lines = [origin, *self.report.facts[:3], *self.report.choices]
            members = [member.name for pose in self.poses for member in pose.character.members]
            labels = model_library.learned(
                settings, copy(self.model), lines, members, first_names, keeps_names=self.lesson is not None
            )
            self.uid = part_ids.model_of(labels)
            return labels
        return model_library.adjusted(settings, self.uid, copy(self.model))


def _show_number_of(model: core.PoseSegmentation, settings: WKSSegmentSettings, report: Report) -> None:
    """Show the number of a taught model's segments in the field; the report is told if another one was asked for."""
    number = min(model.n_segments_, MAX_COLORS)
    if settings.number() in ("auto", number):
        return
    report.warn(Message("The model has the {count} segments that it was taught", count=model.n_segments_))
    with unheard():
        settings.n_segments = number


def without_transferred(objects: Sequence[bpy.types.Object], report: Report) -> list[bpy.types.Object]:
    """The objects without those that have another object's segments, if others are among them.

    An outfit is no pose of the body whose segments it has. It is reported.
    """
    transferred = [obj for obj in objects if origin_of(obj.data).transferred]
    if not transferred or len(transferred) == len(objects):
        return list(objects)
    names = quoted(obj.name for obj in transferred)
    report.choices.append(Message("{names}: the transferred segments stay, Clear removes them", names=names))
    return [obj for obj in objects if obj not in transferred]
