"""The steps that the operators and the command line share: learn, label, soften, write.

`learn`, `label` and `soften` need no Blender, so that a thread can run them; `LabelRequest.of` reads what
they need, `write_outputs` writes.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import bpy
import numpy as np

from ... import core
from ...core import PartNotes
from ...core.mesh.triangle_mesh import FloatArray, IntArray
from ...core.message import Message, message_of
from ...core.progress import Progress
from ...core.user_labels import UnlikePartsError
from ..errors import TooLargeError, UserError
from ..outputs.labels import rewrite_labels, write_labels
from ..outputs.marked_edges import marked_pairs
from ..outputs.options import OutputOptions
from ..outputs.origin import Origin, enter_origin, origin_of
from ..outputs.vertex_weights import soft_weights, weights_of_parts
from ..parts import part_ids
from ..props.label_set import style_of
from ..props.settings import WKSSegmentSettings
from ..scene.characters import Character, polygon_ranges, vertex_ranges
from ..scene.mesh_arrays import Body
from ..scene.poses import Pose
from . import carry_over, model_library, segment_list
from .describing import CONNECTED_TO_LEARN, Prepared, Run, describe, prepare
from .report import Report
from .teaching import Lesson

SEGMENT_SHARE = 0.6
"""Share of the labeling progress that is spent on segments; the rest tells left from right. A wrong share only makes
the progress bar uneven."""
DRAFT_ABOVE = 4.0
"""Estimated seconds of a job above which it begins with a draft: before, the segments themselves are there soon."""
TAUGHT_MIN_SHARE = 0.2
"""How much smaller a region of a taught part may be than *Smallest Part* says: a paw of a fox has 0.5 % of the area,
and is wanted if it was taught."""


@dataclass(frozen=True)
class LabelRequest:
    """Settings of labels, and the meshes that they are for: all that labeling needs beside poses.

    Attributes
    ----------
    min_share : float
        Smallest region, as a share of the area.
    sides : "one" or "two"
    outputs : OutputOptions
        What is written with the labels.
    bodies
        The whole mesh of each character that is labeled.
    """

    min_share: float
    sides: str
    outputs: OutputOptions
    bodies: dict[Character, Body]

    @classmethod
    def of(cls, settings: WKSSegmentSettings, characters: Iterable[Character]) -> LabelRequest:
        """Read the settings, and the characters' own meshes."""
        return cls(
            settings.min_share / 100,
            settings.sides,
            options_of(settings),
            {
                character: Body.of(character, marked_pairs(character, settings.snap_to))
                for character in dict.fromkeys(characters)
            },
        )


def check_limits(model: core.PoseSegmentation, poses: Sequence[Pose], settings: WKSSegmentSettings) -> None:
    """Raise TooLargeError, with the estimate, if the signatures of poses need more time or memory than is allowed."""
    from ...core.spectral.memory import available_memory

    seconds, needed = model.estimate([pose.mesh for pose in poses])
    allowed = 1e9 * settings.limit_memory or available_memory()
    if seconds <= 60 * settings.limit_minutes and needed <= allowed:
        return
    raise TooLargeError(
        "{count} poses of up to {vertices:,} vertices take about {minutes:,.1f} minutes and {memory:,.1f} GB of "
        "memory; allowed are {allowed_minutes:,.1f} minutes and {allowed_memory:,.1f} GB: raise the limit, take fewer "
        "poses, or learn from a decimated copy and apply the model to this mesh",
        count=len(poses),
        vertices=max(pose.mesh.n_vertices for pose in poses),
        minutes=seconds / 60,
        memory=needed / 1e9,
        allowed_minutes=settings.limit_minutes,
        allowed_memory=allowed / 1e9,
    )


def learn(
    model: core.PoseSegmentation, poses: Sequence[Pose], run: Run, lesson: Lesson | None = None
) -> list[core.Workpiece]:
    """Fit a model to poses, and to the parts of a lesson if there is one; return the described poses.

    Raises
    ------
    UserError
        If the core refuses a pose or the model's parameters; the message names it.
    """
    n_faces = max(int(pose.polygon_of.max()) + 1 for pose in poses)
    if lesson is None and model.n_segments != "auto" and model.n_segments > n_faces:
        raise UserError(
            '"{character}" has too few faces ({faces}) for {segments} segments: take fewer segments, or subdivide it',
            character=poses[0].character.name,
            faces=n_faces,
            segments=model.n_segments,
        )
    from ...core.poses.describe import LEARNING

    prepared = prepare(model, poses, run)
    run = _draft(model, poses, run, prepared)
    share = prepared.describing_share(model, poses, LEARNING)
    progress = run.progress.part(CONNECTED_TO_LEARN, 1.0) if share > 0 else run.progress
    described = describe(model, poses, run.with_progress(progress.part(0.0, share)), prepared)
    progress = progress.part(share, 1.0).titled("Learning the segments")
    with run.report.stage("mixture"):
        try:
            if lesson is None:
                model.fit(described, progress, poses[0].upright, run.cache)
            else:
                _fit_to(lesson, model, described, poses[0], run.with_progress(progress))
        except ValueError as error:
            raise UserError("The segments could not be learned: {reason}", reason=message_of(error)) from error
    run.report.add_model(model)
    return described


def _fit_to(
    lesson: Lesson, model: core.PoseSegmentation, described: Sequence[core.Workpiece], first: Pose, run: Run
) -> None:
    """Fit a model to the parts of a lesson, and give it their names; parts of the same shape become one if they may.

    Raises
    ------
    UserError
        If two other parts have the same shape.
    ValueError
        If the core refuses the parts.
    """
    while True:
        try:
            model.fit(
                described, run.progress, first.upright, run.cache, labels=lesson.labels, unlabeled=lesson.unlabeled
            )
        except UnlikePartsError as error:
            lesson, told = lesson.joined(*error.parts)
            run.report.warn(told)
        except ValueError as error:
            raise lesson.named(error) from error
        else:
            model.part_notes_ = PartNotes(names=dict(enumerate(lesson.names)))
            return


def _draft(model: core.PoseSegmentation, poses: Sequence[Pose], run: Run, prepared: Prepared) -> Run:
    """Hand a draft of each pose's labels on, if the job is long; the run with the progress that is left."""
    from ...core.draft.segments import SECONDS, draft
    from ...core.poses.describe import LEARNING

    seconds = prepared.seconds(model, poses, LEARNING)
    if run.on_draft is None or seconds < DRAFT_ABOVE:
        return run
    # The draft takes part in nothing that follows: the result is the same without it.
    distinct, share = list(prepared.known), SECONDS / (SECONDS + seconds)
    with run.report.stage("draft"):
        meshes, connections = [poses[i].mesh for i in distinct], list(prepared.connections.values())
        labels = draft(model, meshes, connections, run.progress.part(0.0, share))
    if labels is not None:
        of_distinct = dict(zip(distinct, labels, strict=True))
        run.on_draft(
            [
                _most_common(of_distinct[original], pose.polygon_of)
                for pose, original in zip(poses, prepared.originals, strict=True)
            ]
        )
    return run.with_progress(run.progress.part(share, 1.0))


def _most_common(of_triangles: IntArray, polygon_of: IntArray) -> IntArray:
    """(p,) label that most triangles of each polygon have; -1 for a polygon without a triangle."""
    own = polygon_of >= 0
    table = np.zeros((int(polygon_of.max()) + 1, int(of_triangles.max()) + 1), dtype=np.int64)
    np.add.at(table, (polygon_of[own], of_triangles[own]), 1)
    return np.asarray(np.where(table.any(axis=1), table.argmax(axis=1), -1))


def label(
    model: core.PoseSegmentation,
    poses: Sequence[Pose],
    described: Sequence[core.Workpiece],
    request: LabelRequest,
    run: Run,
) -> dict[Character, IntArray]:
    """Part of each polygon of each character; one result for all poses and all objects that share a mesh."""
    labels: dict[Character, IntArray] = {}
    with run.report.stage("label"):
        groups = poses_by_mesh(poses)
        for i, group in enumerate(groups):
            character = poses[group[0]].character
            views = MeshViews([poses[j] for j in group], [described[j] for j in group], request.bodies[character])
            parts = _parts_of(model, views, request, run.progress.part(i / len(groups), (i + 1) / len(groups)))
            labels |= {poses[j].character: parts for j in group}
    run.report.add_labels(np.concatenate(list(labels.values())))
    if request.sides == "two" and model.taught_ is None and len(run.report.parts) == run.report.n_segments:
        run.report.warn(
            "Left and right are not told apart with the method of the paper: both sides are one part"
            if model.sides_ is None
            else "No segment has parts on both sides: does X point to the character's left when it is at rest?"
        )
    return labels


@dataclass(frozen=True)
class MeshViews:
    """One mesh in all of its poses: the poses, the same described, and the whole mesh."""

    poses: list[Pose]
    described: list[core.Workpiece]
    body: Body

    @property
    def name(self) -> str:
        """Name of the character."""
        return self.poses[0].character.name

    @property
    def polygon_of_triangles(self) -> list[IntArray]:
        """For each pose, the polygon of each triangle."""
        return [pose.polygon_of for pose in self.poses]


def _parts_of(model: core.PoseSegmentation, views: MeshViews, request: LabelRequest, progress: Progress) -> IntArray:
    """(p,) part of each polygon of a mesh."""
    two_sides = request.sides == "two"
    min_share = None if model.preset == "paper" else request.min_share
    if model.taught_ is not None and min_share is not None:
        min_share *= TAUGHT_MIN_SHARE
    stage = Message('Segments of "{character}"', character=views.name)
    step = progress.part(0.0, SEGMENT_SHARE if two_sides else 1.0, stage)
    step(0.0)
    parts = model.segment_polygons(
        views.described,
        views.polygon_of_triangles,
        min_share,
        step,
        marked=views.body.marked,
    )
    if two_sides:
        stage = Message('Left and right of "{character}"', character=views.name)
        sides = model.polygon_sides(
            views.described, views.polygon_of_triangles, parts, progress.part(SEGMENT_SHARE, 1.0, stage)
        )
        parts = part_ids.from_segments(parts, sides)
    return filled(parts, views.body)


def soften(
    model: core.PoseSegmentation, poses: Sequence[Pose], described: Sequence[core.Workpiece],
    labels: dict[Character, IntArray], request: LabelRequest, run: Run,
) -> dict[Character, dict[int, FloatArray]] | None:  # fmt: skip
    """Weights of each part at each character's vertices, one result for all poses of a mesh as in `label`.

    None if the request is not for soft vertex groups.
    """
    if request.outputs.vertex_groups != "soft":
        return None
    weights: dict[Character, dict[int, FloatArray]] = {}
    with run.report.stage("label"):
        groups = poses_by_mesh(poses)
        for i, group in enumerate(groups):
            character = poses[group[0]].character
            body = request.bodies[character]
            stage = Message('Weights of "{character}"', character=character.name)
            progress = run.progress.part(i / len(groups), (i + 1) / len(groups), stage)
            of_segments = soft_weights(model, [poses[j] for j in group], [described[j] for j in group], body, progress)
            of_parts = weights_of_parts(of_segments, labels[character], body)
            weights |= {poses[j].character: of_parts for j in group}
    return weights


def poses_by_mesh(poses: Sequence[Pose]) -> list[list[int]]:
    """Groups of indices of poses whose characters share their meshes."""
    meshes = [pose.character.meshes for pose in poses]
    return [[i for i, other in enumerate(meshes) if other == mesh] for mesh in dict.fromkeys(meshes)]


def write_outputs(
    settings: WKSSegmentSettings, labels: dict[Character, IntArray], request: LabelRequest, report: Report,
    weights: dict[Character, dict[int, FloatArray]] | None = None, origin: Origin | None = None,
) -> None:  # fmt: skip
    """Write labels with the user's edits, and the weights from `soften`, to the objects of each character.

    Names, colors, merges and faces by hand are those of the label set that the labels are from; without an `origin`
    that of each mesh, since only the labels are new.
    """
    if weights is None and request.outputs.vertex_groups == "soft":
        report.warn("The vertex groups are hard: only a model gives the probabilities of soft ones (Apply to Selected)")
    names: dict[str, int] = {}
    merged: set[tuple[str, int]] = set()
    not_taken_back: list[str] = []
    with report.stage("write"):
        if origin is not None:
            carry_over.change_sets(settings, labels, origin.labels)
        for character, parts in labels.items():
            ranges = zip(polygon_ranges(character), vertex_ranges(character), strict=True)
            for (obj, polygons), (_, vertices) in ranges:
                if polygons.stop == polygons.start:
                    continue
                own = None if weights is None else {part: w[vertices] for part, w in weights[character].items()}
                from_ = origin_of(obj.data) if origin is None else origin
                notes, style = settings.notes(from_.labels), style_of(from_.labels)
                options = replace(request.outputs, style=style)
                written = write_labels(obj.data, parts[polygons], options, notes.joined, own, not_taken_back)
                enter_origin(obj.data, from_)
                names |= {style.name_of(part): part for part in part_ids.unique_parts(written)}
                given = set(np.unique(parts[polygons]).tolist())
                merged |= {(from_.labels, part) for part in given & notes.joined.keys()}
        segment_list.fill(settings)
    report.warn(*not_taken_back)
    report.add_written(names, len(merged))


def options_of(settings: WKSSegmentSettings) -> OutputOptions:
    """What the settings ask to be written."""
    return OutputOptions(
        colors=settings.write_colors,
        ucupaint=settings.write_ucupaint,
        materials=settings.write_materials,
        template=settings.material_template.name if settings.material_template is not None else "",
        vertex_groups=settings.vertex_groups,
        face_sets=settings.write_face_sets,
        seams=settings.write_seams,
    )


def rewrite_outputs(settings: WKSSegmentSettings, mesh: bpy.types.Mesh, warnings: list[str]) -> None:
    """Write the labels of a mesh again with the outputs of the settings; soft groups stay, or are hard.

    `warnings` gets what was not taken back of the labels before, and why.
    """
    origin = origin_of(mesh)
    options = replace(options_of(settings), style=style_of(origin.labels))
    rewrite_labels(mesh, options.style, settings.notes(origin.labels).joined, warnings, options)


def stored_model(settings: WKSSegmentSettings) -> core.PoseSegmentation:
    """The model that was learned in or loaded into this scene; UserError if there is none."""
    if not settings.model:
        raise UserError("No model yet: use Learn and Segment, or import a model")
    return model_library.from_text(settings.model)


def filled(labels: IntArray, body: Body) -> IntArray:
    """(p,) labels of all polygons of a body: one without a label, masked out for example, takes the nearest one's."""
    places = body.polygon_centers
    labels = np.concatenate([labels, np.full(len(places) - len(labels), -1)])
    missing = labels < 0
    if missing.any():
        import scipy

        labels[missing] = labels[~missing][scipy.spatial.cKDTree(places[~missing]).query(places[missing])[1]]
    return labels
