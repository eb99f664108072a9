"""The demo: learn parts from some poses of an animation, and measure on all how consistent the labels are."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from ...core import PoseSegmentation
from ...core.mesh.triangle_mesh import FloatArray, IntArray
from ..errors import UserError
from ..outputs.origin import Origin
from ..props.settings import WKSSegmentSettings
from ..render.contact_sheet import Tile, render_poses
from ..scene import file_formats
from ..scene import poses as reader
from ..scene.characters import Character
from ..scene.poses import Pose
from ..workflow import describing, model_library, pipeline
from ..workflow.describing import Run
from ..workflow.followed_settings import values_of
from ..workflow.pipeline import LabelRequest
from ..workflow.report import pose_warnings, shape_warnings
from .creature import FIRST_FRAME, LAST_FRAME, build_creature
from .reading import warn_at_once
from .results import rounded_seconds, save_model

DEMO_SUFFIXES = {"scene": ".blend", "picture": ".png", "model": ".json"}
LEARNED_SHARE, LABELED_SHARE = 0.5, 0.9
"""Shares of the progress after which the model is learned, and after which all poses are labeled."""


def creature_in(scene: bpy.types.Scene) -> Character:
    """Build the creature in a scene, and set the frames of the scene to those of its animation."""
    scene.frame_start, scene.frame_end = FIRST_FRAME, LAST_FRAME
    return Character((build_creature(scene),))


@dataclass(frozen=True)
class Demo:
    """A demo on frames of an animation.

    Attributes
    ----------
    character : Character
    path : path
        Path of the results without suffix: .blend is added for the labeled character, .png for a picture of all poses,
        and .json for the model.
    n_learned, n_unseen : int
        Number of poses to learn from and of others to check on.
    """

    character: Character
    path: Path
    n_learned: int
    n_unseen: int

    def run(self, context: bpy.types.Context, settings: WKSSegmentSettings, run: Run) -> dict[str, Any]:
        """Learn, label, measure and write the results.

        Returns
        -------
        dict
            Vertices and agreement of each pose, seconds of each stage, mean agreement of the unseen poses, files.

        Raises
        ------
        UserError
            If the animation has too few frames, or a file cannot be written.
        """
        frames = self._frames(context.scene)
        is_learned = spread(len(frames), self.n_learned)
        paths = self._result_paths()
        with run.report.stage("read"):
            poses = reader.read_frames(context, self.character, frames)
        run.report.poses = poses
        warn_at_once(run.report, *shape_warnings(poses), *pose_warnings(poses, len(poses)))
        model = settings.new_model()
        labels = self._labels(model, poses, is_learned, settings, run)
        areas = [polygon_areas(pose, len(labels[0])) for pose in poses]
        agreement = agreements(labels, is_learned, areas)
        run.progress(0.95, "Picture")
        with run.report.stage("render"):
            captions = [
                f"{frame} {'learned' if known else 'unseen'}" for frame, known in zip(frames, is_learned, strict=True)
            ]
            render_poses([Tile(*row) for row in zip(poses, labels, captions, strict=True)], paths["picture"])
        save_model(model, paths["model"])
        file_formats.save_scene(paths["scene"])
        return {
            "poses": [
                {"name": pose.name, "vertices": pose.mesh.n_vertices, "learned": known, "agreement": round(share, 4)}
                for pose, known, share in zip(poses, is_learned, agreement, strict=True)
            ],
            "segments": run.report.n_segments,
            "parts": run.report.parts,
            **({} if run.report.certainty is None else {"certainty": run.report.certainty}),
            "notes": run.report.notes,
            "seconds": rounded_seconds(run.report),
            "agreement": round(float(np.mean(np.array(agreement)[~np.array(is_learned)])), 4),
            "warnings": run.report.warnings,
            "files": {kind: str(path) for kind, path in paths.items()},
        }

    def _frames(self, scene: bpy.types.Scene) -> list[int]:
        if self.n_learned < 1 or self.n_unseen < 1:
            raise UserError("The demo needs at least one pose to learn from and one to check on")
        count = self.n_learned + self.n_unseen
        frames = reader.own_frames(scene, self.character, count)
        if len(frames) < count:
            raise UserError(
                "The demo needs {count} poses, but the animation has only {frames} frames",
                count=count, frames=len(frames),
            )  # fmt: skip
        return frames

    def _result_paths(self) -> dict[str, Path]:
        """Path of each result, in a folder that exists; UserError if they cannot be written."""
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise UserError(
                "{folder}: the folder could not be made: {reason}", folder=self.path.parent, reason=error.strerror
            ) from error
        paths = {kind: self.path.with_name(self.path.name + suffix) for kind, suffix in DEMO_SUFFIXES.items()}
        for path in paths.values():
            file_formats.check_folder(path)
        return paths

    def _labels(
        self, model: PoseSegmentation, poses: Sequence[Pose], is_learned: Sequence[bool],
        settings: WKSSegmentSettings, run: Run,
    ) -> list[IntArray]:  # fmt: skip
        """Fit the model, write labels of the learned poses to the character, and label each pose by itself."""
        training = [pose for pose, known in zip(poses, is_learned, strict=True) if known]
        others = [pose for pose, known in zip(poses, is_learned, strict=True) if not known]
        request = LabelRequest.of(settings, [self.character])
        pipeline.check_limits(model, poses, settings)
        described = pipeline.learn(model, training, run.with_progress(run.progress.part(0.0, LEARNED_SHARE)))
        learned = run.with_progress(run.progress.part(LEARNED_SHARE, LEARNED_SHARE))
        together = pipeline.label(model, training, described, request, learned)
        weights = pipeline.soften(model, training, described, together, request, learned)
        summary = [f"From {self.character.name}", *run.report.facts[:3]]
        names = [member.name for member in self.character.members]
        key = model_library.learned(settings, copy(model), summary, names, self.character.name)
        origin = Origin(key, values_of(settings))
        pipeline.write_outputs(settings, together, request, run.report, weights, origin)
        written = run.report.n_segments, run.report.parts

        described += describing.describe(
            model, others, run.with_progress(run.progress.part(LEARNED_SHARE, LABELED_SHARE))
        )
        labeled = run.with_progress(run.progress.part(LABELED_SHARE, LABELED_SHARE))
        labels = {
            pose.name: pipeline.label(model, [pose], [signature], request, labeled)[self.character]
            for pose, signature in zip(training + others, described, strict=True)
        }
        run.report.n_segments, run.report.parts = written  # the report is about the labels in the scene
        return [labels[pose.name] for pose in poses]


def spread(count: int, n_learned: int) -> list[bool]:
    """For each of `count` poses in a row whether it is learned; these are spread evenly."""
    chosen = set(reader.evenly(0, count - 1, n_learned))
    return [i in chosen for i in range(count)]


def polygon_areas(pose: Pose, n_polygons: int) -> FloatArray:
    """(p,) area of each polygon."""
    return np.bincount(pose.polygon_of, weights=pose.mesh.face_areas, minlength=n_polygons).astype(np.float64)


def agreements(labels: Sequence[IntArray], is_learned: Sequence[bool], areas: Sequence[FloatArray]) -> list[float]:
    """For each pose the share of its area with the label that most of the learned poses give to the same polygon."""
    values, columns = np.unique(np.stack(labels), return_inverse=True)
    columns = columns.reshape(len(labels), -1)
    votes = np.zeros((columns.shape[1], len(values)))
    for column, known in zip(columns, is_learned, strict=True):
        if known:
            votes[np.arange(len(column)), column] += 1
    usual = votes.argmax(axis=1)
    return [float(area @ (column == usual) / area.sum()) for column, area in zip(columns, areas, strict=True)]
