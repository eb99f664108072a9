"""`batch`: the door to the room of the same name, which runs the command line in child processes."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy

from .... import __version__
from ....batch import (
    CHILD_COMMAND,
    Answer,
    Batch,
    BatchError,
    Job,
    Limits,
    Program,
    find_inputs,
    hash_models,
    job_key,
    merge_logs,
    python_program,
    result_names,
    serve,
)
from ....core.progress import Progress
from ...errors import UserError
from ...scene import file_formats
from .options import (
    add_cache,
    add_labeling,
    add_model,
    add_output_settings,
    add_pose_sources,
    add_settings,
    as_arguments,
    within,
)

MODELS, THUMBNAILS = ".json", "thumbnails"
TIME_LIMIT = 3600.0
"""Seconds for a file, if nothing is said."""


def add(commands: Any) -> None:
    """Add the command to a parser's."""
    batch = commands.add_parser("batch", help="the same for many files, each in a process of its own, on many machines")
    kinds = batch.add_subparsers(required=True, metavar="WHAT")
    learn = kinds.add_parser("learn", help="a model of each file")
    _add_batch(learn)
    add_pose_sources(learn)
    add_settings(learn)
    learn.set_defaults(run=_run, jobs_of=_learning)
    apply = kinds.add_parser("apply", help="the parts that a model finds in each file")
    _add_batch(apply)
    add_model(apply)
    apply.add_argument(
        "--format", choices=[suffix[1:] for suffix in file_formats.EXPORTERS], default="blend",
        help="of the files that are written (default: blend)",
    )  # fmt: skip
    add_pose_sources(apply)
    add_labeling(apply)
    add_output_settings(apply)
    apply.set_defaults(run=_run, jobs_of=_applying)
    rank = kinds.add_parser("rank", help="which of several models fits each file")
    _add_batch(rank)
    rank.add_argument("--models", type=Path, required=True, metavar="DIR", help="folder of the models to compare")
    add_pose_sources(rank)
    add_settings(rank)
    rank.set_defaults(run=_run, jobs_of=_ranking)
    report = kinds.add_parser("report", help="put the lists of all parts of a batch into one, and write its report")
    report.add_argument("--output", type=Path, required=True, metavar="DIR", help="the folder of the batch")
    report.set_defaults(run=_report)
    for kind in kinds.choices.values():
        kind.add_argument("--json", action="store_true", default=argparse.SUPPRESS, help="print one JSON object")
    batch.set_defaults(text=_text)


def add_child(commands: Any, answer: Callable[[list[str]], Answer]) -> None:
    """Add the command that a batch starts its children by; it is in no help."""
    child = commands.add_parser(CHILD_COMMAND)
    child.add_argument("folder", type=Path)

    def run(options: argparse.Namespace, progress: Progress) -> dict[str, Any]:
        serve(options.folder, answer)
        return {}

    child.set_defaults(run=run, text=lambda result: "")


def program() -> Program:
    """How to start another process of this Blender, or of this Python, with this extension."""
    # The preferences do not tell: they lack what --addons enabled.
    addon, inside, _ = __package__.partition(".wks_segment.blender")
    if not (bpy.app.binary_path and inside):
        return python_program()
    start = ["--factory-startup"] if "--factory-startup" in sys.argv else []
    enabled = ["--threads", "1", "--addons", addon]
    return Program((bpy.app.binary_path, "--background", *start, *enabled, "--command", "wks_segment", CHILD_COMMAND))


def _add_batch(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "inputs", nargs="+", metavar="INPUT",
        help=f"files, folders, or patterns as 'in/**/*.glb': {', '.join(file_formats.IMPORTERS)}",
    )  # fmt: skip
    parser.add_argument(
        "--output", type=Path, required=True, metavar="DIR", help="a folder for results, list and report"
    )
    cores = os.cpu_count() or 1
    parser.add_argument(
        "--processes", type=within(int, 1, 1024), default=cores, metavar="N",
        help=f"files at once on this machine (default: {cores}, its cores)",
    )  # fmt: skip
    parser.add_argument(
        "--time-limit", type=within(float, 1, 1e7), default=TIME_LIMIT, metavar="SECONDS",
        help=f"what takes longer is ended and counts as failed (default: {TIME_LIMIT:g})",
    )  # fmt: skip
    parser.add_argument(
        "--memory-limit", type=within(float, 0.01, 100_000), metavar="GB",
        help="a process that takes more is ended, its file counts as failed (default: 0.9 of what is free at first)",
    )  # fmt: skip
    parser.add_argument("--resume", action="store_true", help="go on with the batch in the folder: do what is not done")
    parser.add_argument("--retry", action="store_true", help="with --resume: also do again what failed")
    parser.add_argument(
        "--part", type=_part, metavar="I/N", help="do every N-th file only, from the I-th on, as one of N such commands"
    )
    parser.add_argument(
        "--scheduler", metavar="tcp://HOST:PORT", help="have the files done by the workers of this Dask scheduler"
    )
    parser.add_argument("--no-thumbnails", action="store_true", help="render no pictures for the report")
    add_cache(parser)


def _part(text: str) -> tuple[int, int]:
    i, _, n = text.partition("/")
    if not (i.isdecimal() and n.isdecimal() and 1 <= int(i) <= int(n)):
        raise argparse.ArgumentTypeError(f"must be I/N, whole numbers with 1 ≤ I ≤ N, not {text!r}")
    return int(i), int(n)


def _run(options: argparse.Namespace, progress: Progress) -> dict[str, Any]:
    memory = None if options.memory_limit is None else round(1e9 * options.memory_limit)
    try:
        jobs = _jobs(options)
        batch = Batch(
            options.output, jobs, program(), options.processes, Limits(options.time_limit, memory), options.scheduler,
            options.part, options.resume, options.retry,
        )  # fmt: skip
        return batch.run(Progress.of(progress))
    except BatchError as error:
        raise UserError(str(error)) from error


def _report(options: argparse.Namespace, progress: Progress) -> dict[str, Any]:
    try:
        return merge_logs(options.output)
    except BatchError as error:
        raise UserError(str(error)) from error


def _jobs(options: argparse.Namespace) -> list[Job]:
    """One for each file."""
    found = find_inputs(options.inputs, file_formats.IMPORTERS, options.output)
    command, arguments, outputs, contents = options.jobs_of(options)
    # A thread in each process, or these would fight for the cores.
    means = ["--threads=1"]
    if options.cache:
        means += [f"--cache={options.cache.resolve()}", f"--cache-limit={options.cache_limit}"]
    jobs = []
    for (path, _), name in zip(found, result_names(found), strict=True):
        named = {option: pattern.format(name) for option, pattern in outputs.items()}
        key = job_key(path, [__version__, command, *arguments, *contents, *outputs.values()])
        jobs.append(Job(str(path), name, command, (*arguments, *means), named, key))
    return jobs


def _learning(options: argparse.Namespace) -> tuple[str, list[str], dict[str, str], list[str]]:
    """Command, its arguments, patterns of outputs, and what else they depend on."""
    outputs = {"--model": "{}" + MODELS} | _thumbnail(options)
    return "learn" if options.no_thumbnails else "segment", as_arguments(options), outputs, []


def _applying(options: argparse.Namespace) -> tuple[str, list[str], dict[str, str], list[str]]:
    outputs = {"--output": "{}." + options.format} | _thumbnail(options)
    arguments, contents = _known_models(options.model, options.models)
    return "apply", [*as_arguments(options), *arguments], outputs, contents


def _ranking(options: argparse.Namespace) -> tuple[str, list[str], dict[str, str], list[str]]:
    arguments, contents = _known_models(None, options.models)
    return "rank", [*as_arguments(options), *arguments], {}, contents


def _known_models(model: Path | None, folder: Path | None) -> tuple[list[str], list[str]]:
    """Arguments for a model or a folder of models, and what they hold."""
    if model is not None:
        if not model.is_file():
            raise BatchError(f"{model}: there is no such file")
        return [f"--model={model.resolve()}"], [hash_models(model)]
    assert folder is not None
    if not folder.is_dir():
        raise BatchError(f"{folder}: there is no such folder")
    return [f"--models={folder.resolve()}"], [hash_models(folder)]


def _thumbnail(options: argparse.Namespace) -> dict[str, str]:
    return {} if options.no_thumbnails else {"--render": THUMBNAILS + "/{}.png"}


def _text(result: dict[str, Any]) -> str:
    """A result as a person reads it."""
    failed = [f"failed: {name}: {reason}" for name, reason in result["failed"].items()]
    counts = f"{result['done']} of {result['files']} files done, {result['now']} of them now, {len(failed)} failed"
    return "\n".join([*failed, counts, f"list: {result['list']}", f"report: {result['report']}"])
