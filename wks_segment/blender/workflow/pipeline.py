"""What the operators and the command line do, without either, step by step: describe, learn, label, write.

All but the last know no Blender, and so run in a thread as well; `Wanted` is what they need of it.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import bpy
import numpy as np
from scipy.spatial import cKDTree

from ...core import (
    Cache,
    Connection,
    PoseSegmentation,
    SignatureCache,
    SpectrumError,
    SpectrumWarning,
    Workpiece,
    connect,
)
from ...core.mesh.triangle_mesh import FloatArray, IntArray
from ...core.poses.describe import Progress
from ...core.segmentation import DESCRIBED
from ...core.spectral.memory import available_memory
from ..errors import TooLargeError, UserError
from ..outputs.marked_edges import marked_pairs
from ..outputs.overrides import write_edited
from ..outputs.vertex_weights import by_parts, soft_weights
from ..parts import part_ids
from ..parts.part_style import Style
from ..props.settings import WKSSegmentSettings
from ..scene import poses as reader
from ..scene.characters import Character
from ..scene.mesh_arrays import Body
from ..scene.poses import Pose
from . import model_library, segment_list
from .report import Report

CUT = 0.6
"""Share of the time that labels take where left is told from right, too."""


@dataclass(frozen=True)
class Wanted:
    """What the settings ask of labels, and what these are for: all that is read beside poses.

    Attributes
    ----------
    min_share : float
        Smallest connected part, as a share of the area.
    sides : "one" or "two"
    vertex_groups : "none", "hard" or "soft"
    colors, materials, face_sets, seams : bool
        Whether they are written.
    template : str
        Name of the material that those of parts are copies of; empty: none.
    style : Style
    bodies
        Of the characters that are labeled.
    """

    min_share: float
    sides: str
    vertex_groups: str
    colors: bool
    materials: bool
    face_sets: bool
    seams: bool
    template: str
    style: Style
    bodies: dict[Character, Body]

    @classmethod
    def of(cls, settings: WKSSegmentSettings, characters: Iterable[Character]) -> Wanted:
        """Read the settings, and the characters' own meshes."""
        return cls(
            settings.min_share / 100,
            settings.sides,
            settings.vertex_groups,
            settings.write_colors,
            settings.write_materials,
            settings.write_face_sets,
            settings.write_seams,
            settings.material_template.name if settings.material_template is not None else "",
            settings.style(),
            {
                character: Body.of(character, marked_pairs(character, settings.snap_to))
                for character in dict.fromkeys(characters)
            },
        )


def check_limits(model: PoseSegmentation, poses: Sequence[Pose], settings: WKSSegmentSettings) -> None:
    """Raise TooLargeError, with the estimate, if the signatures of poses need more time or memory than is allowed."""
    seconds, needed = model.estimate([pose.mesh for pose in poses])
    allowed = 1e9 * settings.limit_memory or available_memory()
    if seconds <= 60 * settings.limit_minutes and needed <= allowed:
        return
    most = max(pose.mesh.n_vertices for pose in poses)
    raise TooLargeError(
        f"{len(poses)} poses of up to {most:,} vertices take about {seconds / 60:,.1f} minutes and {needed / 1e9:,.1f} "
        f"GB of memory; allowed are {settings.limit_minutes:,.1f} minutes and {allowed / 1e9:,.1f} GB: raise the "
        "limit, take fewer poses, or learn from a decimated copy and apply the model to this mesh"
    )


def learn(
    model: PoseSegmentation, poses: Sequence[Pose], report: Report, progress: Progress,
    cache: Cache | None = None, workers: int | None = None,
) -> list[Workpiece]:  # fmt: skip
    """Fit a model to poses; what is known of each pose.

    Raises
    ------
    UserError
        If the core refuses a pose or the model's parameters; the message names it.
    """
    most = max(int(pose.polygon_of.max()) + 1 for pose in poses)
    if model.n_segments != "auto" and model.n_segments > most:
        raise UserError(
            f'"{poses[0].character.name}" has {most} faces, too few for {model.n_segments} segments: '
            "take fewer segments, or subdivide it"
        )
    described = describe(model, poses, report, progress, DESCRIBED, cache, workers)
    with report.stage("mixture"):
        try:
            model.fit(described, lambda stage, share: progress("Learning the segments", share), poses[0].upright, cache)
        except ValueError as error:
            raise UserError(f"The segments could not be learned: {error}") from error
    report.tell_of(model)
    return described


def describe(
    model: PoseSegmentation, poses: Sequence[Pose], report: Report, progress: Progress, share: float = 1.0,
    cache: SignatureCache | None = None, workers: int | None = None,
) -> list[Workpiece]:  # fmt: skip
    """Signature of each pose, to be labeled; poses that are one and the same surface are computed once.

    What is in the cache is not computed at all.
    """
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
                    workers=workers,
                    cache=cache,
                )
        except (ValueError, SpectrumError, MemoryError) as error:
            raise UserError(str(error)) from error
        report.warnings += dict.fromkeys(
            str(warning.message) for warning in said if issubclass(warning.category, SpectrumWarning)
        )
        # What others said meanwhile, in Blender's own thread too, is theirs.
        for warning in said:
            if not issubclass(warning.category, SpectrumWarning):
                warnings.warn_explicit(warning.message, warning.category, warning.filename, warning.lineno)
    of = dict(zip(new, map(Workpiece, described), strict=True))
    report.laplacians = [of[first].pose.laplacian for first in same]
    return [of[first] for first in same]


def label(
    model: PoseSegmentation, poses: Sequence[Pose], described: Sequence[Workpiece],
    wanted: Wanted, report: Report, progress: Progress,
) -> dict[Character, IntArray]:  # fmt: skip
    """Part of each of a character's polygons, agreed on by all of its poses, and by all objects that share a mesh."""
    labels: dict[Character, IntArray] = {}
    min_share = None if model.preset == "paper" else wanted.min_share
    cut = CUT if wanted.sides == "two" else 1.0
    with report.stage("label"):
        together = of_one_mesh(poses)
        for number, mine in enumerate(together):
            character = poses[mine[0]].character
            body = wanted.bodies[character]

            def of_pose(share: float, number: int = number, name: str = character.name) -> None:
                progress(f'Labels of "{name}"', (number + cut * share) / len(together))

            found = model.segment_polygons(
                [described[i] for i in mine],
                [poses[i].polygon_of for i in mine],
                min_share,
                of_pose,
                marked=body.marked,
            )
            if wanted.sides == "two":
                sides = model.polygon_sides(
                    [described[i] for i in mine],
                    [poses[i].polygon_of for i in mine],
                    found,
                    lambda share, number=number, name=character.name: progress(
                        f'Left and right of "{name}"', (number + cut + (1 - cut) * share) / len(together)
                    ),
                )
                found = part_ids.from_segments(found, sides)
            found = filled(found, body)
            labels |= {poses[i].character: found for i in mine}
    report.tell_of_parts(np.concatenate(list(labels.values())))
    if wanted.sides == "two" and len(report.parts) == report.n_segments:
        report.warn(
            "Left and right are not told apart with the method of the paper: parts are one for both sides"
            if model.sides_ is None
            else "No segment has parts on both sides: does X point to the character's left when it is at rest?"
        )
    return labels


def soften(
    model: PoseSegmentation, poses: Sequence[Pose], described: Sequence[Workpiece],
    labels: dict[Character, IntArray], wanted: Wanted, report: Report, progress: Progress,
) -> dict[Character, dict[int, FloatArray]] | None:  # fmt: skip
    """For each part the weights of each character's vertices, agreed on as labels are.

    None if no soft groups are asked for.
    """
    if wanted.vertex_groups != "soft":
        return None
    weights: dict[Character, dict[int, FloatArray]] = {}
    with report.stage("label"):
        together = of_one_mesh(poses)
        for number, mine in enumerate(together):
            character = poses[mine[0]].character
            body = wanted.bodies[character]

            def of_pose(share: float, number: int = number, name: str = character.name) -> None:
                progress(f'Weights of "{name}"', (number + share) / len(together))

            found = soft_weights(model, [poses[i] for i in mine], [described[i] for i in mine], body, of_pose)
            of_parts = by_parts(found, labels[character], body)
            weights |= {poses[i].character: of_parts for i in mine}
    return weights


def of_one_mesh(poses: Sequence[Pose]) -> list[list[int]]:
    """Indices of poses whose characters share their meshes, together."""
    meshes = [pose.character.meshes for pose in poses]
    return [[i for i, other in enumerate(meshes) if other == mesh] for mesh in dict.fromkeys(meshes)]


def write(
    settings: WKSSegmentSettings, labels: dict[Character, IntArray], wanted: Wanted, report: Report,
    soft: dict[Character, dict[int, FloatArray]] | None = None, renumbered: bool = False,
) -> None:  # fmt: skip
    """Write labels, and the weights that `soften` gave, to the objects of each character, with the user's edits.

    If parts may have other numbers than those that are on the objects now, since the model is new, the edits follow.
    """
    if soft is None and wanted.vertex_groups == "soft":
        report.warn("The vertex groups are hard: only a model says how probable a segment is (Apply to Selected)")
    if renumbered:
        segment_list.carry_over(settings, labels)
    notes, style, written = settings.notes(), settings.style(), [np.zeros(0, dtype=np.int64)]
    template = bpy.data.materials.get(wanted.template)
    with report.stage("write"):
        for character, values in labels.items():
            ranges = zip(reader.polygon_ranges(character), reader.vertex_ranges(character), strict=True)
            for (obj, polygons), (_, vertices) in ranges:
                if polygons.stop == polygons.start:
                    continue
                weights = None if soft is None else {part: of[vertices] for part, of in soft[character].items()}
                final = write_edited(
                    obj.data, values[polygons], style, notes.joined, wanted.colors, wanted.materials, weights,
                    wanted.vertex_groups != "none" and soft is None, wanted.face_sets, wanted.seams, template,
                )  # fmt: skip
                written.append(final)
        segment_list.fill(settings)
    report.parts = {style.name_of(part): part for part in part_ids.unique_parts(np.concatenate(written))}


def stored_model(settings: WKSSegmentSettings) -> PoseSegmentation:
    """The model that was learned in or loaded into this scene; UserError if there is none."""
    if not settings.model:
        raise UserError("No model yet: learn one with Learn and Segment, or load one from a file")
    return model_library.from_text(settings.model)


def filled(labels: IntArray, body: Body) -> IntArray:
    """Labels for all polygons of a body: one that is not seen (masked out, say) takes that of the nearest one."""
    places = body.polygons
    labels = np.concatenate([labels, np.full(len(places) - len(labels), -1)])
    unseen = labels < 0
    if unseen.any():
        labels[unseen] = labels[~unseen][cKDTree(places[~unseen]).query(places[unseen])[1]]
    return labels
