"""The demo: learn from some poses, apply to others, and measure how well the parts stay the same."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
import numpy as np

from ...core.mesh.triangle_mesh import FloatArray, IntArray
from ...core.progress import Progress
from ..errors import UserError
from ..props.settings import WKSSegmentSettings
from ..render.contact_sheet import Tile, render_poses
from ..scene import file_formats
from ..scene import poses as reader
from ..scene.characters import Character
from ..workflow import model_library, pipeline
from ..workflow.pipeline import LabelRequest, Run
from ..workflow.report import Report, pose_warnings
from .creature import FIRST_FRAME, LAST_FRAME, build_creature

SUFFIXES = {"scene": ".blend", "picture": ".png", "model": ".json"}


def creature(context: bpy.types.Context) -> Character:
    """Build the creature in the current scene."""
    scene = context.scene
    scene.frame_start, scene.frame_end = FIRST_FRAME, LAST_FRAME
    return Character((build_creature(scene),))


def run(
    context: bpy.types.Context, character: Character, settings: WKSSegmentSettings, path: Path,
    n_learned: int, n_unseen: int, progress: Progress,
) -> dict[str, Any]:  # fmt: skip
    """Learn a character's parts from frames of its animation and check them on other frames.

    Writes `path` with the suffixes .blend (the labeled character), .png (all poses side by side) and .json (the
    model).

    Returns
    -------
    dict
        Poses with vertices and agreement, seconds a stage, mean agreement of the unseen poses, files.

    Raises
    ------
    UserError
        If the character has too few frames, or a file cannot be written.
    """
    if n_learned < 1 or n_unseen < 1:
        raise UserError("The demo needs a pose to learn from and one to check on")
    report = Report([])
    frames = reader.own_frames(context.scene, character, n_learned + n_unseen)
    if len(frames) < n_learned + n_unseen:
        raise UserError(f"{n_learned + n_unseen} poses are asked for, but the animation has only {len(frames)} frames")
    learned = split(len(frames), n_learned)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(f"{path.parent}: the folder could not be made: {error.strerror}") from error
    paths = {kind: path.with_name(path.name + suffix) for kind, suffix in SUFFIXES.items()}
    for written in paths.values():
        file_formats.check_folder(written)
    with report.stage("read"):
        poses = reader.read_frames(context, character, frames)
    report.poses = poses
    training = [pose for pose, known in zip(poses, learned, strict=True) if known]
    others = [pose for pose, known in zip(poses, learned, strict=True) if not known]
    model, request = settings.new_model(), LabelRequest.of(settings, [character])
    pipeline.check_limits(model, poses, settings)
    described = pipeline.learn(model, training, Run(report, progress.part(0.0, 0.5)))
    at_half = Run(report, progress.part(0.5, 0.5))
    together = pipeline.label(model, training, described, request, at_half)
    soft = pipeline.soften(model, training, described, together, request, at_half)
    model_library.store_active(settings)
    pipeline.write_outputs(settings, together, request, report, soft, renumbered=True)
    counted = report.n_segments, report.parts
    described += pipeline.describe(model, others, Run(report, progress.part(0.5, 0.9)))
    after = Run(report, progress.part(0.9, 0.9))
    labels_of = {
        pose.name: pipeline.label(model, [pose], [signature], request, after)[character]
        for pose, signature in zip(training + others, described, strict=True)
    }
    report.n_segments, report.parts = counted
    own = [labels_of[pose.name] for pose in poses]
    agreement = agreements(own, learned, [polygon_areas(pose, len(own[0])) for pose in poses])

    progress(0.95, "Picture")
    with report.stage("render"):
        captions = [f"{frame} {'learned' if known else 'unseen'}" for frame, known in zip(frames, learned, strict=True)]
        render_poses([Tile(*of_pose) for of_pose in zip(poses, own, captions, strict=True)], paths["picture"])
    try:
        model.save(paths["model"])
    except ValueError as error:
        raise UserError(f"{paths['model']}: {error}") from error
    except OSError as error:
        raise UserError(f"{paths['model']}: the model could not be written: {error.strerror or error}") from error
    model_library.keep(settings, model, [f"From {character.name}", *report.facts[:3]], character.name, add=True)
    file_formats.save_scene(paths["scene"])
    return {
        "poses": [
            {"name": pose.name, "vertices": pose.mesh.n_vertices, "learned": known, "agreement": round(share, 4)}
            for pose, known, share in zip(poses, learned, agreement, strict=True)
        ],
        "segments": report.n_segments,
        "parts": report.parts,
        **({} if report.certainty is None else {"certainty": report.certainty}),
        "notes": report.notes,
        "seconds": {name: round(seconds, 3) for name, seconds in report.seconds.items()},
        "agreement": round(float(np.mean([a for a, known in zip(agreement, learned, strict=True) if not known])), 4),
        "warnings": [*report.warnings, *pose_warnings(poses, from_frames=True)],
        "files": {kind: str(path) for kind, path in paths.items()},
    }


def split(count: int, n_learned: int) -> list[bool]:
    """For each of `count` poses in a row whether it is learned from; the unseen ones lie between them."""
    chosen = set(reader.evenly(0, count - 1, n_learned))
    return [i in chosen for i in range(count)]


def polygon_areas(pose: reader.Pose, n_polygons: int) -> FloatArray:
    """(p,) area of each polygon."""
    return np.bincount(pose.polygon_of, weights=pose.mesh.face_areas, minlength=n_polygons).astype(np.float64)


def agreements(labels: list[IntArray], learned: list[bool], areas: list[FloatArray]) -> list[float]:
    """For each pose the share of its area whose label is the one that most learned poses give to the polygon."""
    found, columns = np.unique(np.stack(labels), return_inverse=True)
    columns = columns.reshape(len(labels), -1)
    votes = np.zeros((columns.shape[1], len(found)))
    for of_pose, known in zip(columns, learned, strict=True):
        if known:
            votes[np.arange(len(of_pose)), of_pose] += 1
    usual = votes.argmax(axis=1)
    return [float(a @ (of_pose == usual) / a.sum()) for of_pose, a in zip(columns, areas, strict=True)]
