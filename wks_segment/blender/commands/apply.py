"""`apply`."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from ...core.description import Progress
from .. import files, models, tasks
from ..errors import UserError
from ..report import Report
from .common import cache_of, check_outputs, label, read_poses, result_of, settings_of
from .options import add_labelling, add_means, add_outputs, add_poses


def add(commands: Any) -> None:
    """Add the command to a parser's."""
    apply = commands.add_parser("apply", help="find the parts of a model in files")
    add_poses(apply)
    apply.add_argument("--model", type=Path, required=True, help="a model that learn or segment wrote")
    add_labelling(apply)
    add_outputs(apply)
    add_means(apply)
    apply.set_defaults(run=_apply)


def _apply(options: argparse.Namespace, progress: Progress) -> dict[str, Any]:
    if not (options.output or options.render):
        raise UserError("apply has nothing to write: give --output, --render or both")
    check_outputs(options)
    cache = cache_of(options)
    model = models.loaded(options.model)
    report = Report([])
    report.tell_of(model)
    poses = read_poses(options, report)
    settings = settings_of(options)
    models.add(settings, model, options.model.stem, [f"From {options.model.name}", f"{model.n_segments_} segments"])
    if options.smoothness is not None:
        model.smoothness = settings.smoothness
    tasks.check_limits(model, poses, settings)
    described = tasks.describe(model, poses, report, progress, cache=cache, workers=options.threads)
    label(model, poses, described, settings, options, report, progress)
    if options.output:
        files.save_scene(options.output)
    return result_of(options, report)
