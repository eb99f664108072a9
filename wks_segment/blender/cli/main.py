"""The command line: `blender --command wks_segment …` and `python -m wks_segment …`. A file a command."""

from __future__ import annotations

import argparse
import json
import sys

from ...batch import Answer
from ..errors import UserError
from .commands import apply, bake, batch, demo, rank, segment
from .commands.common import text_of
from .terminal import only_result_on_stdout, terminal_progress

COMMANDS = (segment, apply, rank, bake, batch, demo)
"""Modules that add a command each, in the order of the help."""


def run(arguments: list[str]) -> int:
    """Run one command; its exit code: 0, 1 (failed, the reason on standard error) or 2 (wrong usage)."""
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
    return 1 if result.get("failed") else 0  # files of a batch, by name


def answer(arguments: list[str]) -> Answer:
    """Run one command of a batch in this process."""
    try:
        options = _parser().parse_args(arguments)
        return Answer(options.run(options, lambda stage, share: None))
    except SystemExit:  # argparse, which has printed why
        return Answer(None, f"wrong usage: {' '.join(arguments)}")
    except UserError as error:
        return Answer(None, str(error))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="wks_segment", description="The same parts, labels and colors in every pose of a character."
    )
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    for module in COMMANDS:
        module.add(commands)
    batch.add_child(commands, answer)
    for command in commands.choices.values():
        command.add_argument("--json", action="store_true", help="print one JSON object")
        if command.get_default("text") is None:
            command.set_defaults(text=text_of)
    return parser
