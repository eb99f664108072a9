"""Entry of the command line: `blender --command wks_segment …` and `python -m wks_segment …`."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

from ...batch import CHILD_COMMAND, Answer, serve
from ...core.progress import Progress
from ..errors import UserError
from .commands import apply, bake, batch, demo, rank, segment
from .results import result_text
from .terminal import only_result_on_stdout, terminal_progress

COMMAND_MODULES = (segment, apply, rank, bake, batch, demo)
"""Modules that each add one or two commands, in the order of the help."""


def run(arguments: list[str]) -> int:
    """Run one command; return its exit code.

    Returns
    -------
    int
        0 if the command succeeded; 1 if it failed, with the reason on standard error; 2 for wrong usage.
    """
    options = _parser().parse_args(arguments)
    with only_result_on_stdout() as stdout:
        try:
            with terminal_progress() as progress:
                result = options.run(options, progress)
        except UserError as error:
            print(f"wks_segment: {error}", file=sys.stderr)
            if options.json:
                print(json.dumps({"error": str(error)}), file=stdout)
            return 1
        print(json.dumps(result) if options.json else options.text(result), file=stdout)
    return 1 if result.get("failed") else 0  # files of a batch that failed


def answer(arguments: list[str]) -> Answer:
    """Run one command of a batch in this process, without output on the terminal."""
    try:
        options = _parser().parse_args(arguments)
        return Answer(options.run(options, Progress()))
    except SystemExit:  # from argparse, which has printed the reason
        return Answer(None, f"wrong usage: {' '.join(arguments)}")
    except UserError as error:
        return Answer(None, str(error))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="wks_segment", description="The same parts, labels and colors in every pose of a character."
    )
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    for module in COMMAND_MODULES:
        module.add(commands)
    child = commands.add_parser(CHILD_COMMAND)  # not in the help: a batch starts its children with it
    child.add_argument("folder", type=Path)
    child.set_defaults(run=_serve, text=_no_text)
    for command in commands.choices.values():
        command.add_argument("--json", action="store_true", help="print one JSON object")
        if command.get_default("text") is None:
            command.set_defaults(text=result_text)
    return parser


def _serve(options: argparse.Namespace, progress: Progress) -> dict[str, Any]:
    """Run as the child process of a batch."""
    serve(options.folder, answer)
    return {}


def _no_text(result: dict[str, Any]) -> str:
    return ""
