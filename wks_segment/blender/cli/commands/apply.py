"""`apply`."""

from __future__ import annotations

import argparse
from typing import Any

from ....core import Cache, MemoryCache
from ....core.progress import Progress
from ...errors import UserError
from ...scene import file_formats
from ...workflow import model_library, pipeline
from ...workflow.model_ranking import largest, rank_poses, verdict_message
from ...workflow.pipeline import Run
from ...workflow.report import Report
from .common import cache_of, candidates_in, check_outputs, label, read_poses, result_of, settings_of
from .options import add_labeling, add_means, add_model, add_outputs, add_poses


def add(commands: Any) -> None:
    """Add the command to a parser's."""
    apply = commands.add_parser("apply", help="find the parts of a model in files")
    add_poses(apply)
    add_model(apply)
    add_labeling(apply)
    add_outputs(apply)
    add_means(apply)
    apply.set_defaults(run=_apply)


def _apply(options: argparse.Namespace, progress: Progress) -> dict[str, Any]:
    if not (options.output or options.render):
        raise UserError("apply has nothing to write: give --output, --render or both")
    check_outputs(options)
    cache: Cache | None = cache_of(options)
    report = Report([])
    best = None
    if options.models is None:
        model, name = model_library.loaded(options.model), options.model.stem
        poses = read_poses(options, report)
    else:
        found = candidates_in(options.models, report)
        poses = read_poses(options, report)
        pipeline.check_limits(largest(found), poses, settings_of(options))
        # What is described for the ranking serves labeling.
        cache = cache or MemoryCache()
        ranking = rank_poses(found, poses, Run(report, progress, cache, options.threads))
        model, name = found[ranking.best.index].model, found[ranking.best.index].name
        best = {"best": name, "verdict": ranking.verdict}
        if ranking.verdict != "sure":
            report.warn(verdict_message(ranking, [candidate.name for candidate in found]))
    report.add_model(model)
    settings = settings_of(options)
    model_library.add_model(settings, model, name, [f"From {name}", f"{model.n_segments_} segments"])
    if options.smoothness is not None:
        model.smoothness = settings.smoothness
    pipeline.check_limits(model, poses, settings)
    described = pipeline.describe(model, poses, Run(report, progress, cache, options.threads))
    label(model, poses, described, settings, options, report, progress)
    if options.output:
        file_formats.save_scene(options.output)
    return result_of(options, report) | (best or {})
