"""Command `apply`: label poses with a given model, or with the best of several."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from copy import copy
from dataclasses import replace
from typing import Any

from ....core import MemoryCache, Ranking
from ....core.progress import Progress
from ...errors import UserError
from ...scene import file_content, file_formats
from ...scene.poses import Pose
from ...workflow import describing, model_library, pipeline
from ...workflow.describing import Run
from ...workflow.model_ranking import NamedModel, fit_warning, largest, rank_poses, verdict_message
from ...workflow.report import Report, absent_warnings
from ..command_options import (
    add_labeling_settings,
    add_model,
    add_outputs,
    add_poses,
    add_resources,
    cache_from,
    settings_from,
)
from ..reading import read_models, read_poses
from ..results import check_outputs, label_and_write, result_of

RANKED = 0.9
"""Share of the time after which the best model is known: its signatures serve to label as well."""


def add(commands: Any) -> None:
    """Add the command to the subparsers of the command line."""
    apply = commands.add_parser("apply", help="find the parts of a model in files")
    add_poses(apply)
    add_model(apply)
    add_labeling_settings(apply)
    add_outputs(apply)
    add_resources(apply)
    apply.set_defaults(run=_apply)


def _apply(options: argparse.Namespace, progress: Progress) -> dict[str, Any]:
    if not (options.output or options.render):
        raise UserError("apply has nothing to write: give --output, --render or both")
    check_outputs(options)
    run = Run(Report([]), progress, cache_from(options), options.threads)
    verdict = {}
    if options.models is None:
        chosen = NamedModel(file_content.name_of(options.model), model_library.loaded(options.model))
        poses = read_poses(options, run.report, single=False)
    else:
        models = read_models(options.models, run.report)
        poses = read_poses(options, run.report, single=False)
        # Signatures that are computed for the ranking serve to label as well.
        run = replace(run, cache=run.cache or MemoryCache())
        ranking = _rank(models, poses, options, run.with_progress(run.progress.part(0.0, RANKED)))
        run = run.with_progress(run.progress.part(RANKED, 1.0))
        chosen = models[ranking.best.index]
        verdict = {"best": chosen.name, "verdict": ranking.verdict}
    model = chosen.model
    run.report.add_model(model)
    settings = settings_from(options)
    model_library.add_model(
        settings, copy(model), chosen.name, [f"From {chosen.name}", f"{model.n_segments_} segments"]
    )
    if options.smoothness is not None:
        model.smoothness = settings.smoothness
    pipeline.check_limits(model, poses, settings)
    described, rest = describing.describe_to_label(model, poses, run)
    label_and_write(model, poses, described, settings, options, run.with_progress(rest))
    if options.models is None:
        for pose, signature in zip(poses, described, strict=True):
            warning = fit_warning([chosen], [signature.pose], pose.character.name)
            run.report.warn(*([] if warning is None else [warning]))
    run.report.warn(*absent_warnings(model, run.report))
    if options.output:
        file_formats.save_scene(options.output, options.unfinished)
    return result_of(options, run.report) | verdict


def _rank(models: Sequence[NamedModel], poses: Sequence[Pose], options: argparse.Namespace, run: Run) -> Ranking:
    """Rank models by how well they fit the poses; warn if none fits for sure."""
    pipeline.check_limits(largest(models), poses, settings_from(options))
    ranking = rank_poses(models, poses, run)
    if ranking.verdict != "sure":
        run.report.warn(verdict_message(ranking, [named.name for named in models]))
    return ranking
