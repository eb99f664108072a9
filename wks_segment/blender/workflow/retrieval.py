"""The paper's retrieval experiment: learn some shapes of each class in a folder, and find the class of the others."""

from __future__ import annotations

import re
from copy import copy
from pathlib import Path

import bpy

from ... import core
from ...core.message import Message, message_of
from ..errors import UserError
from ..props.settings import WKSSegmentSettings
from ..scene import file_formats
from ..scene import poses as reader
from ..scene.animation import Choice, animated
from ..scene.characters import Character, group, mesh_objects
from ..scene.poses import Pose
from . import describing, pipeline
from .describing import Run
from .report import Report

LEARN_CLASS_SHARE = 0.6
"""Share of a class's progress that learning takes; the rest describes the shapes that are asked for."""


def evaluate(folder: Path, settings: WKSSegmentSettings, n_learned: int, n_frames: int, run: Run) -> core.Retrieval:
    """Learn a model of each class in a folder, and find the class of the shapes that were not learned.

    A sub-folder is a class, and each file in it a shape; an animated file beside it is a class, and frames of its
    animation are the shapes. Files and classes that cannot be used are left out with a warning.

    Parameters
    ----------
    folder
    settings
        For all models; opening a file may change them, so that they are read once.
    n_learned : int
        Shapes of each class to learn.
    n_frames : int
        Frames to take from an animated file.
    run : Run

    Raises
    ------
    UserError
        If fewer than two classes can be used, or the settings exclude each other.
    """
    models: dict[str, core.PoseSegmentation] = {}
    queries: dict[str, list[core.PoseSignature]] = {}
    unfitted, limits = settings.new_model(), (settings.limit_minutes, settings.limit_memory)
    for (name, paths), progress in run.progress.each(_classes(folder), "Reading"):
        model = copy(unfitted)
        class_run = run.with_progress(progress.titled("{name}: {stage}", name=name))
        try:
            with run.report.stage("read"):
                is_animation = folder == paths[0].parent
                poses = _frames_of(paths[0], n_frames) if is_animation else _shapes_of(paths, run.report)
            _check_class(model, poses, n_learned, limits)
            queries[name] = _learn_class(model, poses, n_learned, class_run)
        except UserError as error:
            run.report.warn(Message("The class {name} was left out: {reason}", name=name, reason=message_of(error)))
            continue
        models[name] = model
    if len(models) < 2:
        reasons = [
            Message(
                "{folder}: there are {count} classes that can be used, and at least two are needed: sub-folders with "
                "one shape in each file, or animated files",
                folder=folder,
                count=len(models),
            ),
            *run.report.warnings,
        ]
        raise UserError(Message.joined("; ", reasons))
    with run.report.stage("rank"):
        return core.retrieve(models, queries)


def _check_class(model: core.PoseSegmentation, poses: list[Pose], n_learned: int, limits: tuple[float, float]) -> None:
    """UserError if there are too few shapes, or they are too large for the limits of minutes and memory."""
    if len(poses) <= n_learned:
        raise UserError(
            "there are {count} shapes that can be used, but {learned} are learned and at least one more is needed",
            count=len(poses),
            learned=n_learned,
        )
    settings = bpy.context.scene.wks_segment
    settings.limit_minutes, settings.limit_memory = limits
    pipeline.check_limits(model, poses, settings)


def _learn_class(model: core.PoseSegmentation, poses: list[Pose], n_learned: int, run: Run) -> list[core.PoseSignature]:
    """Fit the model to some of the poses; return the others described."""
    from ...core.ranking import spread_evenly

    learned = spread_evenly(len(poses), n_learned)
    with run.progress.step(LEARN_CLASS_SHARE) as progress:
        pipeline.learn(model, [poses[i] for i in learned], run.with_progress(progress))
    asked = [pose for i, pose in enumerate(poses) if i not in learned]
    described = []
    for pose, progress in run.progress.each(asked):
        # Each alone: poses of one mesh that are described together share a connection, which a query must not.
        described += describing.describe(model, [pose], run.with_progress(progress))
    return [each.pose for each in described]


def _classes(folder: Path) -> list[tuple[str, list[Path]]]:
    """(name, files) of each class, in natural order."""
    if not folder.is_dir():
        raise UserError("{folder}: there is no such folder", folder=folder)
    classes: list[tuple[str, list[Path]]] = []
    for path in sorted(folder.iterdir(), key=_natural_order):
        if path.is_dir():
            shapes = [shape for shape in sorted(path.iterdir(), key=_natural_order) if _can_import(shape)]
            if shapes:
                classes.append((path.name, shapes))
        elif _can_import(path):
            classes.append((path.stem, [path]))
    return classes


def _can_import(path: Path) -> bool:
    return path.suffix.lower() in file_formats.IMPORTERS


def _natural_order(path: Path) -> list[tuple[int, str]]:
    """Sort key by which 2 comes before 10."""
    return [(int(word), "") if word.isdigit() else (-1, word) for word in re.split(r"(\d+)", path.name.lower()) if word]


def _shapes_of(paths: list[Path], report: Report) -> list[Pose]:
    """The shape in each file: all of its meshes together."""
    poses: list[Pose] = []
    for path in paths:
        try:
            (objects,) = file_formats.open_files([path])
            (pose,) = reader.read_objects(bpy.context, group(mesh_objects(objects), together=True))
        except UserError as error:
            report.warn(Message("{file} was left out: {reason}", file=path.name, reason=message_of(error)))
            continue
        poses.append(pose)
    return poses


def _frames_of(path: Path, count: int) -> list[Pose]:
    """Poses at frames spread evenly over the animation of what moves in a file."""
    (objects,) = file_formats.open_files([path])

    def frames_of(character: Character) -> list[int]:
        return reader.own_frames(bpy.context.scene, character, count)

    with animated(bpy.context, group(mesh_objects(objects)), frames_of, Choice(together=True)) as found:
        character = found.characters[0]
        return reader.read_frames(bpy.context, character, frames_of(character))
