"""Commands `segment` and `learn`: learn a model from poses, and with `segment` label them."""

from __future__ import annotations

import argparse
from copy import copy
from typing import Any

from ....core.progress import Progress
from ...scene import file_formats
from ...workflow import model_library, pipeline
from ...workflow.describing import Run
from ...workflow.report import Report, pose_warnings, segment_warnings
from ...workflow.segmentation_job import LEARN_SHARE
from ...workflow.teaching import read_lesson
from ..command_options import (
    add_outputs,
    add_poses,
    add_resources,
    add_settings,
    add_teaching,
    cache_from,
    settings_from,
    teaching_from,
)
from ..option_types import named_path
from ..reading import read_poses, warn_at_once
from ..results import check_outputs, label_and_write, result_of, save_model


def add(commands: Any) -> None:
    """Add the commands to the subparsers of the command line."""
    segment = commands.add_parser("segment", help="learn parts from the poses in files, and write them")
    add_poses(segment)
    add_settings(segment)
    add_teaching(segment)
    segment.add_argument("--model", type=named_path, help="write the model to this file")
    add_outputs(segment)
    add_resources(segment)
    segment.set_defaults(run=_segment)
    learn = commands.add_parser("learn", help="learn a model from the poses in files")
    add_poses(learn)
    add_settings(learn)
    add_teaching(learn)
    learn.add_argument("--model", type=named_path, required=True, help="write the model to this file")
    add_resources(learn)
    learn.set_defaults(run=_segment, output=None, render=None)


def _segment(options: argparse.Namespace, progress: Progress) -> dict[str, Any]:
    """Run `segment`, or `learn`, which has no outputs but the model."""
    check_outputs(options)
    run = Run(Report([]), progress, cache_from(options), options.threads)
    if options.model:
        file_formats.check_folder(options.model)
    poses = read_poses(options, run.report)
    settings = settings_from(options)
    lesson = read_lesson(settings, poses, run.report) if teaching_from(options, settings) else None
    asked = None if options.frames is None else options.frames[2] - len(run.report.left_out)
    warn_at_once(run.report, *([] if lesson is not None else pose_warnings(poses, asked)))
    model = settings.new_model()
    pipeline.check_limits(model, poses, settings)
    described = pipeline.learn(model, poses, run.with_progress(run.progress.part(0.0, LEARN_SHARE)), lesson)
    if options.model:
        save_model(model, options.model)
    names = [member.name for pose in poses for member in pose.character.members]
    model_library.learned(
        settings, copy(model), run.report.facts, names, poses[0].character.name, keeps_names=lesson is not None
    )
    if options.output or options.render:
        rest = run.with_progress(run.progress.part(LEARN_SHARE, 1.0))
        label_and_write(model, poses, described, settings, options, rest)
        run.report.warnings += segment_warnings(model, run.report)
    if options.output:
        file_formats.save_scene(options.output, options.unfinished)
    return result_of(options, run.report) | ({} if lesson is None else {"taught": lesson.names})
