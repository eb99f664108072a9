"""`segment` and `learn`."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from ....core.progress import Progress
from ...scene import file_formats
from ...workflow import model_library, pipeline
from ...workflow.pipeline import Run
from ...workflow.report import Report, pose_warnings, segment_warnings
from .common import cache_of, check_outputs, label, read_poses, result_of, save_model, settings_of
from .options import add_means, add_outputs, add_poses, add_settings


def add(commands: Any) -> None:
    """Add the commands to a parser's."""
    segment = commands.add_parser("segment", help="learn parts from the poses in files, and write them")
    add_poses(segment)
    add_settings(segment)
    segment.add_argument("--model", type=Path, help="write the model to this file")
    add_outputs(segment)
    add_means(segment)
    segment.set_defaults(run=_segment)
    learn = commands.add_parser("learn", help="learn a model from the poses in files")
    add_poses(learn)
    add_settings(learn)
    learn.add_argument("--model", type=Path, required=True, help="write the model to this file")
    add_means(learn)
    learn.set_defaults(run=_segment, output=None, render=None)


def _segment(options: argparse.Namespace, progress: Progress) -> dict[str, Any]:
    """`segment` and, without outputs, `learn`."""
    check_outputs(options)
    cache = cache_of(options)
    file_formats.check_folder(options.model) if options.model else None
    report = Report([])
    poses = read_poses(options, report)
    settings = settings_of(options)
    model = settings.new_model()
    pipeline.check_limits(model, poses, settings)
    described = pipeline.learn(model, poses, Run(report, progress, cache, options.threads))
    if options.model:
        save_model(model, options.model)
    model_library.store_active(settings)
    if options.output or options.render:
        label(model, poses, described, settings, options, report, progress, renumbered=True)
        report.warnings += segment_warnings(model, report)
    model_library.keep(settings, model, report.facts, poses[0].character.name, add=True)
    if options.output:
        file_formats.save_scene(options.output)
    report.warnings += pose_warnings(poses, from_frames=options.frames is not None)
    return result_of(options, report)
