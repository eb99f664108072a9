"""What the operators and the command line do, without either: read, hand arrays to the core, write."""

from __future__ import annotations

import time
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field

import bpy
import numpy as np
from scipy.spatial import cKDTree

from ..core import Connection, PoseSegmentation, PoseSignature, SpectrumError, connect
from ..core.description import Progress
from ..core.memory import available_memory
from ..core.mesh import FloatArray, IntArray
from ..core.segmentation import DESCRIBED
from . import parts, segments
from . import poses as reader
from .certainty import certainties, certainty_lines
from .characters import Character, armature_of, group, mesh_objects
from .edits import write_edited
from .errors import TooLargeError, UserError
from .marks import marked_pairs
from .poses import Pose
from .settings import WKSSegmentSettings
from .style import Style
from .weights import by_parts, soft_weights

VOTERS = 5
"""Poses of a mesh that say which of its parts are left and right; more would not say it more surely."""


@dataclass
class Report:
    """What happened: for the status bar, the terminal and `--json`."""

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
            f"{len(self.poses)} pose" + "s" * (len(self.poses) != 1),
            f"{sum(pose.mesh.n_vertices for pose in self.poses):,} vertices",
            parts.counted(self.n_segments, len(self.parts)),
            *([f"better triangles for {improved}"] if (improved := self.laplacians.count("delaunay")) else []),
            f"{sum(self.seconds.values()):.1f} seconds",
        ]


def read_training_poses(context: bpy.types.Context, settings: WKSSegmentSettings, report: Report) -> list[Pose]:
    """Poses to learn from, as the settings say where they are.

    Raises
    ------
    UserError
        If there are none there, or they cannot be used.
    """
    characters = group(mesh_objects(context.selected_objects))
    with report.stage("read"):
        if settings.source == "OBJECTS":
            poses = reader.read_objects(context, characters)
        else:
            character = active_character(context, characters)
            if settings.source == "SHAPE_KEYS":
                poses = reader.read_shape_keys(context, character, settings.pose_count)
            else:
                frames = chosen_frames(context.scene, character, settings)
                poses = reader.read_frames(context, character, frames)
    report.poses = poses
    report.warnings += pose_warnings(poses, settings.source == "FRAMES")
    return poses


def active_character(context: bpy.types.Context, characters: Sequence[Character]) -> Character:
    """The one among the selected characters that the active object is of, or the only one.

    Raises
    ------
    UserError
        If there are several and the active object is of none.
    """
    active = context.active_object
    for character in characters:
        members = (*character.objects, armature_of(character.objects[0]))
        if len(characters) == 1 or (active is not None and active in members):
            return character
    names = ", ".join(character.name for character in characters[:5])
    raise UserError(f"{len(characters)} characters are selected ({names}): click the one whose poses are meant")


def chosen_frames(scene: bpy.types.Scene, character: Character, settings: WKSSegmentSettings) -> list[int]:
    """Frames to take poses from: of the user's range, of the character's own animation, or of the scene's range.

    Raises
    ------
    UserError
        If the user's range ends before it begins.
    """
    if not settings.use_frame_range:
        return reader.own_frames(scene, character, settings.pose_count)
    if settings.frame_last < settings.frame_first:
        raise UserError(
            f"The frame range ends ({settings.frame_last}) before it begins ({settings.frame_first}): swap them"
        )
    return reader.evenly(settings.frame_first, settings.frame_last, settings.pose_count)


def check_limits(model: PoseSegmentation, poses: Sequence[Pose], settings: WKSSegmentSettings) -> None:
    """Raise TooLargeError, with the estimate, if the signatures of poses need more time or memory than is allowed."""
    seconds, needed = model.estimate([pose.mesh for pose in poses])
    allowed = 1e9 * settings.limit_memory or available_memory() or np.inf
    if seconds <= 60 * settings.limit_minutes and needed <= allowed:
        return
    most = max(pose.mesh.n_vertices for pose in poses)
    raise TooLargeError(
        f"{len(poses)} poses of up to {most:,} vertices take about {seconds / 60:,.1f} minutes and {needed / 1e9:,.1f} "
        f"GB of memory; allowed are {settings.limit_minutes:,.1f} minutes and {allowed / 1e9:,.1f} GB: raise the "
        "limit, take fewer poses, or learn from a decimated copy and apply the model to this mesh"
    )


def learn(
    poses: Sequence[Pose], settings: WKSSegmentSettings, report: Report, progress: Progress
) -> tuple[PoseSegmentation, list[PoseSignature]]:
    """Learn a model from poses; the model and the signature of each pose.

    Raises
    ------
    UserError
        If the core refuses a pose or the settings; the message names it.
    """
    model = settings.new_model()
    most = max(int(pose.polygon_of.max()) + 1 for pose in poses)
    if model.n_segments != "auto" and model.n_segments > most:
        raise UserError(
            f'"{poses[0].character.name}" has {most} faces, too few for {model.n_segments} segments: '
            "take fewer segments, or subdivide it"
        )
    described = describe(model, poses, report, progress, share=DESCRIBED)
    with report.stage("mixture"):
        try:
            model.fit(described, lambda stage, share: progress("Learning the segments", share), poses[0].upright)
        except ValueError as error:
            raise UserError(f"The segments could not be learned: {error}") from error
    report.tell_of(model)
    return model, described


def describe(
    model: PoseSegmentation, poses: Sequence[Pose], report: Report, progress: Progress, share: float = 1.0
) -> list[PoseSignature]:
    """Signature of each pose; poses that are one and the same surface are computed once."""
    same = [next((j for j in range(i) if pose.is_like(poses[j])), i) for i, pose in enumerate(poses)]
    new = [i for i, first in enumerate(same) if first == i]
    with report.stage("connect"):
        # One surface in all poses of a mesh, also where pieces of it meet in some.
        connections: dict[int, Connection] = {}
        for i, pose in enumerate(poses):
            first = next(j for j, other in enumerate(poses) if pose.is_mesh_of(other))
            if first == i:
                progress(f'Seams of "{pose.name}"', 0.0)
                alike = [other.mesh for other in poses if pose.is_mesh_of(other)]
                try:
                    connections[i] = connect(*alike, rest=pose.rest, pieces=model.pieces)
                except ValueError as error:
                    raise UserError(f'"{pose.name}": {error}') from error
            connections[i] = connections[first]
    with report.stage("signature"):
        try:
            with warnings.catch_warnings(record=True) as said:
                warnings.simplefilter("always")
                described = model.describe_all(
                    [poses[i].mesh for i in new],
                    [connections[i] for i in new],
                    lambda stage, done: progress(f"Signature of {stage}", share * done),
                    [f'"{poses[i].name}"' for i in new],
                )
        except (ValueError, SpectrumError, MemoryError) as error:
            raise UserError(str(error)) from error
        report.warnings += dict.fromkeys(str(warning.message) for warning in said)
    of = dict(zip(new, described, strict=True))
    report.laplacians = [of[first].laplacian for first in same]
    return [of[first] for first in same]


def label(
    model: PoseSegmentation, poses: Sequence[Pose], described: Sequence[PoseSignature],
    settings: WKSSegmentSettings, report: Report, progress: Progress,
) -> dict[Character, IntArray]:  # fmt: skip
    """Part of each of a character's polygons, agreed on by all of its poses, and by all objects that share a mesh."""
    labels: dict[Character, IntArray] = {}
    min_share = None if model.preset == "paper" else settings.min_share / 100
    with report.stage("label"):
        for mine in of_one_mesh(poses):
            name = poses[mine[0]].character.name
            found = model.segment_polygons(
                [described[i] for i in mine],
                [poses[i].polygon_of for i in mine],
                min_share,
                lambda share, name=name: progress(f'Labels of "{name}"', 1.0),
                marked=marked_pairs(poses[mine[0]].character, settings.snap_to),
            )
            if settings.sides == "two":
                voters = [mine[i] for i in reader.evenly(0, len(mine) - 1, VOTERS)]
                sides = agreed_sides(model, [poses[i] for i in voters], [described[i] for i in voters], found, progress)
                found = parts.numbered(found, sides)
            found = filled(found, poses[mine[0]].character)
            labels |= {poses[i].character: found for i in mine}
    occurring = parts.among(np.concatenate(list(labels.values())))
    report.n_segments = len(np.unique(parts.segments_of(np.array(occurring))))
    report.parts = {parts.name_of(part): part for part in occurring}
    if settings.sides == "two" and len(occurring) == report.n_segments:
        report.warn(
            "Left and right are not told apart with the method of the paper: parts are one for both sides"
            if model.regions_ is None
            else "No segment has parts on both sides: does X point to the character's left when it is at rest?"
        )
    return labels


def agreed_sides(
    model: PoseSegmentation, poses: Sequence[Pose], described: Sequence[PoseSignature], segments: IntArray,
    progress: Progress,
) -> IntArray:  # fmt: skip
    """(p,) side that most poses of a mesh give to each polygon: 1 left, −1 right, 0 neither; given the segments."""
    given = []
    for pose, of_pose in zip(poses, described, strict=True):
        progress(f'Left and right of "{pose.name}"', 1.0)
        given.append(model.polygon_sides(of_pose, pose.polygon_of, segments))
    # Half left and half neither is neither.
    return np.trunc(np.median(given, axis=0)).astype(np.int64)


def soften(
    model: PoseSegmentation, poses: Sequence[Pose], described: Sequence[PoseSignature],
    labels: dict[Character, IntArray], settings: WKSSegmentSettings, report: Report, progress: Progress,
) -> dict[Character, dict[int, FloatArray]] | None:  # fmt: skip
    """For each part the weights of each character's vertices, agreed on as labels are.

    None if the settings ask for no soft groups.
    """
    if settings.vertex_groups != "soft":
        return None
    weights: dict[Character, dict[int, FloatArray]] = {}
    with report.stage("label"):
        for mine in of_one_mesh(poses):
            character = poses[mine[0]].character
            progress(f'Weights of "{character.name}"', 1.0)
            found = soft_weights(model, [poses[i] for i in mine], [described[i] for i in mine])
            of_parts = by_parts(found, labels[character], character)
            weights |= {poses[i].character: of_parts for i in mine}
    return weights


def of_one_mesh(poses: Sequence[Pose]) -> list[list[int]]:
    """Indices of poses whose characters share their meshes, together."""
    meshes = [tuple(obj.data for obj in pose.character.objects) for pose in poses]
    return [[i for i, other in enumerate(meshes) if other == mesh] for mesh in dict.fromkeys(meshes)]


def write(
    labels: dict[Character, IntArray], settings: WKSSegmentSettings, report: Report,
    soft: dict[Character, dict[int, FloatArray]] | None = None, renumbered: bool = False,
) -> None:  # fmt: skip
    """Write labels, and the weights that `soften` gave, to the objects of each character, with the user's edits.

    If parts may have other numbers than those that are on the objects now, since the model is new, the edits follow.
    """
    if renumbered:
        segments.carry_over(settings, labels)
    notes, written = settings.notes(), [np.zeros(0, dtype=np.int64)]
    style = Style.of(notes)
    with report.stage("write"):
        for character, values in labels.items():
            ranges = zip(reader.polygon_ranges(character), reader.vertex_ranges(character), strict=True)
            for (obj, polygons), (_, vertices) in ranges:
                if polygons.stop == polygons.start:
                    continue
                weights = None if soft is None else {part: of[vertices] for part, of in soft[character].items()}
                final = write_edited(
                    obj.data, values[polygons], style, notes.joined, settings.write_colors, settings.write_materials,
                    weights, hard=settings.vertex_groups == "hard",
                )  # fmt: skip
                written.append(final)
        segments.fill(settings)
    report.parts = {style.name_of(part): part for part in parts.among(np.concatenate(written))}


def stored_model(settings: WKSSegmentSettings) -> PoseSegmentation:
    """The model that was learned in or loaded into this scene; UserError if there is none."""
    if not settings.model:
        raise UserError("No model yet: learn one with Learn and Segment, or load one from a file")
    try:
        return PoseSegmentation.from_json(settings.model)
    except ValueError as error:
        raise UserError(f"The model in this file cannot be used: {error}") from error


def filled(labels: IntArray, character: Character) -> IntArray:
    """Labels for all polygons of a character: one that is not seen (masked out, say) takes that of the nearest one."""
    places = reader.places(character, "polygons")
    labels = np.concatenate([labels, np.full(len(places) - len(labels), -1)])
    unseen = labels < 0
    if unseen.any():
        labels[unseen] = labels[~unseen][cKDTree(places[~unseen]).query(places[unseen])[1]]
    return labels


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
