"""`rank`."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from ....core import Ranking
from ....core.progress import Progress
from ...render.confusion_matrix import render_matrix
from ...workflow import pipeline
from ...workflow.model_ranking import NamedModel, largest, rank_poses, verdict_message
from ...workflow.pipeline import Run
from ...workflow.report import Report
from ...workflow.retrieval import evaluate
from ..terminal import table
from .common import cache_of, candidates_in, check_picture, read_poses, settings_of
from .options import add_means, add_poses, add_settings, within

LEARNED, FRAMES = 5, 8
"""Shapes of a class that are learned, and frames of an animated file that are taken, if nothing is said."""


def add(commands: Any) -> None:
    """Add the command to a parser's."""
    rank = commands.add_parser("rank", help="say which of several models fits a file, or how often that is right")
    add_poses(rank, nargs="*")
    rank.add_argument("--models", type=Path, metavar="DIR", help="folder of the models to compare (.json)")
    rank.add_argument(
        "--evaluate", type=Path, metavar="DIR",
        help="learn a model of each class in this folder, and ask for the class of all other shapes in it; a class is "
        "a sub-folder with a file a shape, or an animated file, of which --frames COUNT frames are the shapes",
    )  # fmt: skip
    rank.add_argument(
        "--learned", type=within(int, 1, 1000), default=LEARNED, metavar="N",
        help=f"with --evaluate, shapes of each class that are learned (default: {LEARNED})",
    )  # fmt: skip
    rank.add_argument(
        "--picture", type=Path, metavar="PNG", help="with --evaluate, write a picture of the confusion matrix"
    )
    add_settings(rank)
    add_means(rank)
    rank.set_defaults(run=_rank, text=_text, usage=rank.error)


def _rank(options: argparse.Namespace, progress: Progress) -> dict[str, Any]:
    if options.evaluate is None:
        if not (options.files and options.models):
            options.usage("give FILE and --models DIR, or --evaluate DIR")
        return _rank_files(options, progress)
    if options.files or options.models:
        options.usage("--evaluate takes neither FILE nor --models: it learns its own")
    return _evaluate(options, progress)


def _rank_files(options: argparse.Namespace, progress: Progress) -> dict[str, Any]:
    report, cache = Report([]), cache_of(options)
    candidates = candidates_in(options.models, report)
    results = []
    for path, file_progress in progress.each(options.files, "Reading"):
        poses = read_poses(argparse.Namespace(**vars(options) | {"files": [path]}), report)
        pipeline.check_limits(largest(candidates), poses, settings_of(options))
        for character in dict.fromkeys(pose.character for pose in poses):
            mine = [pose for pose in poses if pose.character == character]
            ranking = rank_poses(candidates, mine, Run(report, file_progress, cache, options.threads))
            results.append({"file": str(path), "character": character.name} | _result(ranking, candidates))
    return {"rankings": results, "seconds": _seconds(report), "warnings": report.warnings}


def _result(ranking: Ranking, candidates: list[NamedModel]) -> dict[str, Any]:
    names = [candidate.name for candidate in candidates]
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
    first, last, count = options.frames or (None, None, FRAMES)
    if first is not None or last is not None:
        options.usage("with --evaluate, --frames takes a COUNT only: each file has its own animation")
    report = Report([])
    run = Run(report, progress, cache_of(options))
    retrieval = evaluate(options.evaluate, settings_of(options), options.learned, count, run)
    if options.picture:
        with report.stage("render"):
            render_matrix(retrieval, options.picture)
    return {
        "classes": retrieval.names,
        "confusion": retrieval.confusion.tolist(),
        "right": retrieval.right,
        "asked": retrieval.asked,
        "rate": round(retrieval.rate, 4),
        "verdicts": {verdict: {"right": r, "wrong": w} for verdict, (r, w) in retrieval.verdicts.items()},
        "seconds": _seconds(report),
        "warnings": report.warnings,
        "files": {"picture": str(options.picture)} if options.picture else {},
    }


def _seconds(report: Report) -> dict[str, float]:
    return {name: round(seconds, 3) for name, seconds in report.seconds.items()}


def _text(result: dict[str, Any]) -> str:
    """A ranking, or the paper's protocol, as a person reads it."""
    lines: list[str] = []
    for one in result.get("rankings", ()):
        rows = [
            [model["name"], f"{model['score']:.3f}", f"{model['probability']:.1%}", "yes" if model["fits"] else "no"]
            for model in one["models"]
        ]
        name = one["file"] if one["character"] in one["file"] else f"{one['file']}, {one['character']}"
        lines += [name, table(["model", "score", "probability", "within its class"], rows), one["says"], ""]
    if "confusion" in result:
        names = result["classes"]
        rows = [[name, *map(str, row)] for name, row in zip(names, result["confusion"], strict=True)]
        lines += [table(["is … taken for", *names], rows), ""]
        lines += [f"right: {result['right']} of {result['asked']} ({result['rate']:.1%})"]
        lines += [f"{verdict}: {n['right']} right, {n['wrong']} wrong" for verdict, n in result["verdicts"].items()]
    lines += [f"warning: {warning}" for warning in result["warnings"]]
    lines += [f"{name}: {path}" for name, path in result.get("files", {}).items()]
    return "\n".join(lines)
