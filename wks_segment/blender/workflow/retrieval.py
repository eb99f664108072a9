"""The paper's retrieval on a folder of classes: some shapes of each are learned, the others asked for."""

from __future__ import annotations

import re
from copy import copy
from pathlib import Path

import bpy

from ...core import Cache, PoseSegmentation, PoseSignature, Retrieval, retrieve
from ...core.poses.describe import Progress
from ...core.ranking import spread_evenly
from ..errors import UserError
from ..props.settings import WKSSegmentSettings
from ..scene import file_formats
from ..scene import poses as reader
from ..scene.characters import group, mesh_objects
from ..scene.poses import Pose
from . import pipeline
from .report import Report


def evaluate(
    folder: Path,
    settings: WKSSegmentSettings,
    n_learned: int,
    n_frames: int,
    report: Report,
    progress: Progress,
    cache: Cache | None = None,
) -> Retrieval:
    """Learn a model of each class in a folder, and ask for the class of what was not learned.

    A sub-folder is a class, and each file in it a shape; an animated file beside it is a class, and frames of its
    animation are the shapes. What cannot be read is named in a warning, and left out.

    Raises
    ------
    UserError
        If fewer than two classes are left, or the settings exclude each other.
    """
    models: dict[str, PoseSegmentation] = {}
    queries: dict[str, list[PoseSignature]] = {}
    # Opening a file takes the settings away.
    unfitted, limits, found = settings.new_model(), (settings.limit_minutes, settings.limit_memory), _classes(folder)
    for number, (name, paths) in enumerate(found):

        def tick(stage: str, share: float, begun: int = number, name: str = name) -> None:
            progress(f"{name}: {stage}", (begun + share) / len(found))

        model = copy(unfitted)
        try:
            with report.stage("read"):
                poses = _frames_of(paths[0], n_frames) if folder == paths[0].parent else _shapes_of(paths, report)
            if len(poses) <= n_learned:
                raise UserError(
                    f"there are {len(poses)} shapes that can be used; {n_learned} are learned, and one at least is "
                    "asked for"
                )
            now = bpy.context.scene.wks_segment
            now.limit_minutes, now.limit_memory = limits
            pipeline.check_limits(model, poses, now)
            learned = spread_evenly(len(poses), n_learned)
            pipeline.learn(
                model, [poses[i] for i in learned], report, lambda stage, share: tick(stage, 0.6 * share), cache
            )
            asked = [pose for i, pose in enumerate(poses) if i not in learned]
            described = []
            for i, pose in enumerate(asked):
                tick(f"Signature of {pose.name}", 0.6 + 0.4 * i / len(asked))
                described += pipeline.describe(model, [pose], report, lambda stage, share: None, cache=cache)
        except UserError as error:
            report.warn(f"The class {name} was left out: {error}")
            continue
        models[name], queries[name] = model, [work.pose for work in described]
    if len(models) < 2:
        raise UserError(
            f"{folder}: there are {len(models)} classes that can be used, and at least two are needed: sub-folders "
            "with a file a shape, or animated files" + "".join(f"; {warning}" for warning in report.warnings)
        )
    with report.stage("rank"):
        return retrieve(models, queries)


def _classes(folder: Path) -> list[tuple[str, list[Path]]]:
    """(name, files) of each class, in the order that a person would give them."""
    if not folder.is_dir():
        raise UserError(f"{folder}: there is no such folder")
    found: list[tuple[str, list[Path]]] = []
    for path in sorted(folder.iterdir(), key=_natural):
        if path.is_dir():
            shapes = [shape for shape in sorted(path.iterdir(), key=_natural) if _known(shape)]
            if shapes:
                found.append((path.name, shapes))
        elif _known(path):
            found.append((path.stem, [path]))
    return found


def _known(path: Path) -> bool:
    return path.suffix.lower() in file_formats.IMPORTERS


def _natural(path: Path) -> list[tuple[int, str]]:
    """So that 2 comes before 10."""
    return [(int(word), "") if word.isdigit() else (-1, word) for word in re.split(r"(\d+)", path.name.lower()) if word]


def _shapes_of(paths: list[Path], report: Report) -> list[Pose]:
    """The shape in each file: all of its meshes together."""
    poses: list[Pose] = []
    for path in paths:
        try:
            (objects,) = file_formats.open_files([path])
            (pose,) = reader.read_objects(bpy.context, group(mesh_objects(objects), together=True))
        except UserError as error:
            report.warn(f"{path.name} was left out: {error}")
            continue
        poses.append(pose)
    return poses


def _frames_of(path: Path, count: int) -> list[Pose]:
    """Frames spread over the animation in a file."""
    (objects,) = file_formats.open_files([path])
    (character,) = group(mesh_objects(objects), together=True)
    return reader.read_frames(bpy.context, character, reader.own_frames(bpy.context.scene, character, count))
