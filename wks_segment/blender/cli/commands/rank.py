"""Command `rank`: find the model that fits a character, or measure how often that succeeds."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import Any

from ....core import Ranking
from ....core.progress import Progress
from ...render.confusion_matrix import render_matrix
from ...workflow import pipeline
from ...workflow.describing import Run
from ...workflow.model_ranking import NamedModel, largest, rank_poses, verdict_message
from ...workflow.report import Report
from ...workflow.retrieval import evaluate
from ..command_options import add_poses, add_resources, add_settings, cache_from, settings_from
from ..option_types import named_path, number_within
from ..reading import read_models, read_poses
from ..results import check_picture, rounded_seconds, warnings_and_files
from ..terminal import table

LEARNED_SHAPES = 5
"""Default of the shapes of each class to learn."""
FRAMES_OF_FILE = 8
"""Default of the frames to take from an animated file."""


def add(commands: Any) -> None:
    """Add the command to the subparsers of the command line."""
    rank = commands.add_parser("rank", help="find which of several models fits a file, or how often that is right")
    add_poses(rank, nargs="*")
    rank.add_argument("--models", type=named_path, metavar="DIR", help="folder of the models to compare (.json)")
    rank.add_argument(
        "--evaluate", type=named_path, metavar="DIR",
        help="learn a model of each class in this folder, and find the class of all other shapes in it; a class is a "
        "sub-folder with one shape in each file, or an animated file, of which --frames COUNT frames are the shapes",
    )  # fmt: skip
    rank.add_argument(
        "--learned", type=number_within(int, 1, 1000), default=LEARNED_SHAPES, metavar="N",
        help=f"with --evaluate, number of shapes of each class to learn (default: {LEARNED_SHAPES})",
    )  # fmt: skip
    rank.add_argument(
        "--picture", type=named_path, metavar="PNG", help="with --evaluate, write a picture of the confusion matrix"
    )
    add_settings(rank)
    add_resources(rank)
    rank.set_defaults(run=_rank, text=_text, usage=rank.error)


def _rank(options: argparse.Namespace, progress: Progress) -> dict[str, Any]:
    if options.evaluate is None:
        if not (options.files and options.models):
            options.usage("give FILE and --models DIR, or --evaluate DIR")
        return _rank_files(options, progress)
    if options.files or options.models:
        options.usage("--evaluate learns its own models, so it takes neither FILE nor --models")
    return _evaluate(options, progress)


def _rank_files(options: argparse.Namespace, progress: Progress) -> dict[str, Any]:
    run = Run(Report([]), progress, cache_from(options), options.threads)
    models = read_models(options.models, run.report)
    rankings = []
    for path, of_file in progress.each(options.files):
        poses = read_poses(argparse.Namespace(**vars(options) | {"files": [path]}), run.report)
        pipeline.check_limits(largest(models), poses, settings_from(options))
        characters = list(dict.fromkeys(pose.character for pose in poses))
        for character, of_character in of_file.each(characters):
            own_poses = [pose for pose in poses if pose.character == character]
            ranking = rank_poses(models, own_poses, run.with_progress(of_character))
            rankings.append({"file": str(path), "character": character.name} | _result_of(ranking, models))
    return {"rankings": rankings, "seconds": rounded_seconds(run.report), "warnings": run.report.warnings}


def _result_of(ranking: Ranking, models: Sequence[NamedModel]) -> dict[str, Any]:
    names = [named.name for named in models]
    return {
        "verdict": ranking.verdict,
        "says": verdict_message(ranking, names),
        "models": [
            {
                "name": names[place.index],
                "score": round(place.score, 4),
                "probability": round(place.probability, 4),
                "fits": place.fits,
            }
            for place in ranking.ranks
        ],
    }


def _evaluate(options: argparse.Namespace, progress: Progress) -> dict[str, Any]:
    if options.picture:
        check_picture(options.picture)
    first, last, n_frames = options.frames or (None, None, FRAMES_OF_FILE)
    if first is not None or last is not None:
        options.usage("with --evaluate, --frames takes only a COUNT, since each file has its own animation")
    run = Run(Report([]), progress, cache_from(options))
    retrieval = evaluate(options.evaluate, settings_from(options), options.learned, n_frames, run)
    if options.picture:
        with run.report.stage("render"):
            render_matrix(retrieval, options.picture)
    return {
        "classes": retrieval.names,
        "confusion": retrieval.confusion.tolist(),
        "right": retrieval.right,
        "asked": retrieval.asked,
        "rate": round(retrieval.rate, 4),
        "verdicts": {
            verdict: {"right": right, "wrong": wrong} for verdict, (right, wrong) in retrieval.verdicts.items()
        },
        "seconds": rounded_seconds(run.report),
        "warnings": run.report.warnings,
        "files": {"picture": str(options.picture)} if options.picture else {},
    }


def _text(result: dict[str, Any]) -> str:
    """Text of the rankings, or of the evaluation."""
    lines: list[str] = []
    for ranking in result.get("rankings", ()):
        rows = [
            [model["name"], f"{model['score']:.3f}", f"{model['probability']:.1%}", "yes" if model["fits"] else "no"]
            for model in ranking["models"]
        ]
        file, character = ranking["file"], ranking["character"]
        lines += [file if character in file else f"{file}, {character}"]
        lines += [table(["model", "score", "probability", "within its class"], rows), ranking["says"], ""]
    if "confusion" in result:
        names = result["classes"]
        rows = [[name, *map(str, counts)] for name, counts in zip(names, result["confusion"], strict=True)]
        lines += [table(["class … taken for", *names], rows), ""]
        lines += [f"right: {result['right']} of {result['asked']} ({result['rate']:.1%})"]
        lines += [f"{verdict}: {n['right']} right, {n['wrong']} wrong" for verdict, n in result["verdicts"].items()]
    return "\n".join([*lines, *warnings_and_files(result)])
