"""What the operators and the command line do, without either: read, hand arrays to the core, write."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field

import bpy
import numpy as np

from ..core import PoseSegmentation, PoseSignature, SpectrumError
from ..core.mesh import IntArray
from . import poses as reader
from .characters import Character, group, mesh_objects
from .errors import UserError
from .labels import write_labels
from .poses import Pose
from .settings import WKSSegmentSettings

Progress = Callable[[str, float], None]


@dataclass
class Report:
    """What happened: for the status bar, the terminal and `--json`."""

    poses: list[Pose]
    n_segments: int = 0
    seconds: dict[str, float] = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)

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
            f"{self.n_segments} segments",
            f"{sum(self.seconds.values()):.1f} seconds",
        ]


def read_training_poses(context: bpy.types.Context, settings: WKSSegmentSettings, report: Report) -> list[Pose]:
    """Poses to learn from, as the settings say where they are.

    Raises
    ------
    UserError
        If there are none there, or they cannot be used.
    """
    selected = mesh_objects(context.selected_objects)
    with report.stage("read"):
        if settings.source == "SHAPE_KEYS":
            active = context.active_object
            if active is None or active.type != "MESH":
                raise UserError("No active mesh object: click the object whose shape keys are the poses")
            group([active])
            poses = reader.read_shape_keys(context, active, settings.pose_count)
        elif settings.source == "FRAMES":
            characters = group(selected)
            if len(characters) > 1:
                raise UserError(
                    f"{len(characters)} characters are selected: select one to take frames of, "
                    "or join them under one armature"
                )
            frames = chosen_frames(context.scene, characters[0], settings)
            poses = reader.read_frames(context, characters[0], frames)
        else:
            poses = reader.read_objects(context, group(selected))
    report.poses = poses
    report.warnings += pose_warnings(poses, settings.source == "FRAMES")
    return poses


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
    described = describe(model, poses, report, progress, share=0.9)
    with report.stage("mixture"):
        progress("Learning the segments", 0.9)
        try:
            model.fit(described)
        except ValueError as error:
            raise UserError(f"The segments could not be learned: {error}") from error
    report.n_segments = model.n_segments
    return model, described


def describe(
    model: PoseSegmentation, poses: Sequence[Pose], report: Report, progress: Progress, share: float = 1.0
) -> list[PoseSignature]:
    """Signature of each pose; poses that are one and the same surface are computed once."""
    described: list[PoseSignature] = []
    for i, pose in enumerate(poses):
        progress(f"Signature of {pose.name} ({i + 1} of {len(poses)})", share * i / len(poses))
        twin = next((j for j in range(i) if pose.is_like(poses[j])), None)
        with report.stage("signature"):
            try:
                described.append(model.describe(pose.mesh) if twin is None else described[twin])
            except (ValueError, SpectrumError) as error:
                raise UserError(f'"{pose.name}": {error}') from error
    return described


def label(
    model: PoseSegmentation, poses: Sequence[Pose], described: Sequence[PoseSignature],
    settings: WKSSegmentSettings, report: Report,
) -> dict[Character, IntArray]:  # fmt: skip
    """Components of each character's polygons, agreed on by all of its poses."""
    labels: dict[Character, IntArray] = {}
    with report.stage("label"):
        for character in dict.fromkeys(pose.character for pose in poses):
            mine = [i for i, pose in enumerate(poses) if pose.character == character]
            labels[character] = _filled(
                model.segment_polygons(
                    [described[i] for i in mine], [poses[i].polygon_of for i in mine], settings.min_share / 100
                ),
                poses[mine[0]],
            )
    report.n_segments = len(np.unique(np.concatenate(list(labels.values()))))
    return labels


def write(labels: dict[Character, IntArray], settings: WKSSegmentSettings, report: Report) -> None:
    """Write labels to the objects of each character."""
    with report.stage("write"):
        for character, values in labels.items():
            for obj, polygons in reader.polygon_ranges(character):
                if polygons.stop > polygons.start:
                    write_labels(obj.data, values[polygons], settings.write_colors, settings.write_materials)


def stored_model(settings: WKSSegmentSettings) -> PoseSegmentation:
    """The model that was learned in or loaded into this scene; UserError if there is none."""
    if not settings.model:
        raise UserError("No model yet: learn one with Learn and Segment, or load one from a file")
    try:
        return PoseSegmentation.from_json(settings.model)
    except ValueError as error:
        raise UserError(f"The model in this file cannot be used: {error}") from error


def _filled(labels: IntArray, pose: Pose) -> IntArray:
    """Labels for all polygons of a character: those that are not seen (masked out) take 0 behind the last one."""
    missing = reader.polygon_ranges(pose.character)[-1][1].stop - len(labels)
    return np.concatenate([labels, np.zeros(missing, dtype=labels.dtype)])


def pose_warnings(poses: Sequence[Pose], from_frames: bool) -> list[str]:
    """What the user should know of the poses that were learned from."""
    if len(poses) == 1:
        return ["Learned from one pose only: parts are more reliable with three to five"]
    if all(pose.is_like(poses[0]) for pose in poses[1:]):
        hint = "does an animation move the character in these frames?" if from_frames else "pose them differently"
        return [f"All {len(poses)} poses are the same: {hint}"]
    return []
