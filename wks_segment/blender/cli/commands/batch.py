"""Command `batch`: run `learn`, `apply` or `rank` for many files, each in a child process; see `wks_segment.batch`."""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path
from typing import Any, NamedTuple

import bpy

from .... import __version__
from ....batch import (
    CHILD_COMMAND,
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
)
from ....core.progress import Progress
from ...errors import UserError
from ...scene import file_formats
from ..command_options import (
    add_cache,
    add_labeling_settings,
    add_model,
    add_output_settings,
    add_pose_sources,
    add_settings,
    to_arguments,
)
from ..option_types import batch_part, named, named_path, number_within

TIME_LIMIT = 3600.0
"""Default of the seconds that a file may take."""
THUMBNAIL = {"--render": "thumbnails/{}.png"}
"""Option and file of a picture for the report."""
TILE = ("--tile=320",)
"""Pixels of each pose in it: the report shows fewer, and 480 would take as long as the rest of a small file, without a
graphics card."""


class JobTemplate(NamedTuple):
    """Command that is run for each file.

    Attributes
    ----------
    command : str
    arguments : list of str
    outputs : dict
        Option to a pattern of its file, in which {} stands for the name of the results.
    models : list of str
        Hashes of the models that are applied: other models give other results.
    """

    command: str
    arguments: list[str]
    outputs: dict[str, str]
    models: list[str]


def add(commands: Any) -> None:
    """Add the command to the subparsers of the command line."""
    batch = commands.add_parser("batch", help="run a command for many files, each in its own process")
    kinds = batch.add_subparsers(required=True, metavar="WHAT")
    learn = kinds.add_parser("learn", help="learn a model from each file")
    _add_batch_options(learn)
    add_pose_sources(learn)
    add_settings(learn)
    learn.set_defaults(run=_run, template_of=_learn_template)
    apply = kinds.add_parser("apply", help="find the parts of a model in each file")
    _add_batch_options(apply)
    add_model(apply)
    apply.add_argument(
        "--format", choices=[suffix[1:] for suffix in file_formats.EXPORTERS], default="blend",
        help="format of the files that are written (default: blend)",
    )  # fmt: skip
    add_pose_sources(apply)
    add_labeling_settings(apply)
    add_output_settings(apply)
    apply.set_defaults(run=_run, template_of=_apply_template)
    rank = kinds.add_parser("rank", help="find which of several models fits each file")
    _add_batch_options(rank)
    rank.add_argument("--models", type=named_path, required=True, metavar="DIR", help="folder of the models to compare")
    add_pose_sources(rank)
    add_settings(rank)
    rank.set_defaults(run=_run, template_of=_rank_template)
    report = kinds.add_parser("report", help="merge the lists of all parts of a batch, and write its report")
    report.add_argument("--output", type=named_path, required=True, metavar="DIR", help="the folder of the batch")
    report.set_defaults(run=_report)
    for kind in kinds.choices.values():
        kind.add_argument("--json", action="store_true", default=argparse.SUPPRESS, help="print one JSON object")
    batch.set_defaults(text=_text)


def child_program() -> Program:
    """How to start another process of this Blender, or of this Python, with this extension."""
    # The preferences do not list extensions that were enabled by --addons.
    extension, inside, _ = __package__.partition(".wks_segment.blender")
    if not (bpy.app.binary_path and inside):
        return python_program()
    start = ["--factory-startup"] if "--factory-startup" in sys.argv else []
    enabled = ["--threads", "1", "--addons", extension]
    return Program((bpy.app.binary_path, "--background", *start, *enabled, "--command", "wks_segment", CHILD_COMMAND))


def _add_batch_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "inputs", nargs="+", type=named, metavar="INPUT",
        help=f"files, folders, or patterns such as 'in/**/*.glb': {', '.join(file_formats.IMPORTERS)}",
    )  # fmt: skip
    parser.add_argument(
        "--output",
        type=named_path,
        required=True,
        metavar="DIR",
        help="folder for the results, their list and a report",
    )
    cores = os.cpu_count() or 1
    parser.add_argument(
        "--processes", type=number_within(int, 1, 1024), default=cores, metavar="N",
        help=f"files at the same time on this machine (default: {cores}, its cores)",
    )  # fmt: skip
    parser.add_argument(
        "--time-limit", type=number_within(float, 1, 1e7), default=TIME_LIMIT, metavar="SECONDS",
        help=f"a file that takes longer is stopped and counts as failed (default: {TIME_LIMIT:g})",
    )  # fmt: skip
    parser.add_argument(
        "--memory-limit", type=number_within(float, 0.01, 100_000), metavar="GB",
        help="a file whose process takes more memory is stopped and counts as failed (default: 0.9 of the memory that "
        "is free at the start)",
    )  # fmt: skip
    parser.add_argument("--resume", action="store_true", help="continue the batch in the folder: skip what is done")
    parser.add_argument("--retry", action="store_true", help="with --resume: run failed files again")
    parser.add_argument(
        "--part", type=batch_part, metavar="I/N",
        help="run only every N-th file, beginning with the I-th, as one of N such commands",
    )  # fmt: skip
    parser.add_argument(
        "--scheduler", metavar="tcp://HOST:PORT", help="run the files on the workers of this Dask scheduler"
    )
    parser.add_argument("--no-thumbnails", action="store_true", help="render no pictures for the report")
    add_cache(parser)


def _run(options: argparse.Namespace, progress: Progress) -> dict[str, Any]:
    memory = None if options.memory_limit is None else round(1e9 * options.memory_limit)
    try:
        batch = Batch(
            options.output, _jobs(options), child_program(), options.processes, Limits(options.time_limit, memory),
            options.scheduler, options.part, options.resume, options.retry,
        )  # fmt: skip
        return batch.run(progress)
    except BatchError as error:
        raise UserError(str(error)) from error


def _report(options: argparse.Namespace, progress: Progress) -> dict[str, Any]:
    try:
        return merge_logs(options.output)
    except BatchError as error:
        raise UserError(str(error)) from error


def _jobs(options: argparse.Namespace) -> list[Job]:
    """The job of each input file."""
    inputs = find_inputs(options.inputs, file_formats.IMPORTERS, options.output)
    template: JobTemplate = options.template_of(options)
    # One thread in each process, since processes with more would compete for the cores.
    resources = ["--threads=1"]
    if options.cache:
        resources += [f"--cache={options.cache.resolve()}", f"--cache-limit={options.cache_limit}"]
    settings = [__version__, template.command, *template.arguments, *template.models, *template.outputs.values()]
    jobs = []
    for (path, _), name in zip(inputs, result_names(inputs), strict=True):
        outputs = {option: pattern.format(name) for option, pattern in template.outputs.items()}
        arguments = (*template.arguments, *resources)
        jobs.append(Job(str(path), name, template.command, arguments, outputs, job_key(path, settings)))
    return jobs


def _learn_template(options: argparse.Namespace) -> JobTemplate:
    if options.no_thumbnails:
        return JobTemplate("learn", to_arguments(options), {"--model": "{}.json"}, [])
    return JobTemplate("segment", [*to_arguments(options), *TILE], {"--model": "{}.json"} | THUMBNAIL, [])


def _apply_template(options: argparse.Namespace) -> JobTemplate:
    outputs = {"--output": "{}." + options.format} | ({} if options.no_thumbnails else THUMBNAIL)
    argument, content = _models(options.model, options.models)
    return JobTemplate("apply", [*to_arguments(options), *TILE, argument], outputs, [content])


def _rank_template(options: argparse.Namespace) -> JobTemplate:
    argument, content = _models(None, options.models)
    return JobTemplate("rank", [*to_arguments(options), argument], {}, [content])


def _models(model: Path | None, folder: Path | None) -> tuple[str, str]:
    """Argument for a model or a folder of models, and a hash of their content."""
    if model is not None:
        if not model.is_file():
            raise BatchError(f"{model}: there is no such file")
        return f"--model={model.resolve()}", hash_models(model)
    assert folder is not None
    if not folder.is_dir():
        raise BatchError(f"{folder}: there is no such folder")
    return f"--models={folder.resolve()}", hash_models(folder)


def _text(result: dict[str, Any]) -> str:
    """Text of the result of a batch."""
    failed = [f"failed: {name}: {reason}" for name, reason in result["failed"].items()]
    counts = f"{result['done']} of {result['files']} files done, {result['now']} of them now, {len(failed)} failed"
    return "\n".join([*failed, counts, f"list: {result['list']}", f"report: {result['report']}"])
