"""Entry of the command line: `blender --command wks_segment …` and `python -m wks_segment …`."""

from __future__ import annotations

import argparse
import json
import math
import signal
import sys
import traceback
from functools import cache
from typing import Any, NoReturn

from ... import __version__
from ...batch import CHILD_COMMAND, Answer, serve
from ...core.files.whole_file import is_disk_full
from ...core.progress import Progress
from ...interruption import Interrupted, handled, interruptible
from ..errors import UserError
from ..streams import flush_streams
from .commands import apply, bake, batch, demo, rank, segment
from .option_types import named_path
from .resource_limits import within_limits
from .results import result_text
from .terminal import only_result_on_stdout, terminal_progress

COMMAND_MODULES = (segment, apply, rank, bake, batch, demo)
"""Modules that each add one or two commands, in the order of the help."""


class UsageError(Exception):
    """Options that do not exist, or values that they do not take; the message says which.

    Attributes
    ----------
    usage : str
        How the command is called.
    """

    def __init__(self, message: str, usage: str) -> None:
        super().__init__(message)
        self.usage = usage


class _Parser(argparse.ArgumentParser):
    """Parser that raises wrong usage, so that it can be answered like every other error."""

    def error(self, message: str) -> NoReturn:
        raise UsageError(message, f"{self.format_usage()}{self.prog}")


def run(arguments: list[str]) -> int:
    """Run one command; return its exit code.

    With `--json`, one JSON object is printed on standard output however the command ends: the result, or the reason
    under "error".

    Returns
    -------
    int
        0 if the command succeeded; 1 if it failed, with the reason on standard error; 2 for wrong usage; 130 after
        Ctrl+C, 143 after SIGTERM.
    """
    as_json = "--json" in arguments
    try:
        options = _parser().parse_args(arguments)
    except UsageError as error:
        code, result, _ = _wrong_usage(error)
        if as_json:
            print(json.dumps(result))
        return code
    try:
        with only_result_on_stdout() as stdout:
            code, result, text = _ended(options)
            with handled(signal.SIG_IGN):  # the command has ended
                if as_json:
                    print(json.dumps(_strictly(result), default=str), file=stdout, flush=True)
                elif text:
                    print(text, file=stdout, flush=True)
    except OSError as error:
        return _failure(f"the result cannot be printed: {error.strerror}")[0]
    return code


def _ended(options: argparse.Namespace) -> tuple[int, dict[str, Any], str]:
    """Run a command; its exit code, its result or the reason why there is none, and the result as text."""
    try:
        with interruptible(), terminal_progress() as progress:
            result = options.run(options, within_limits(progress, options))
        code = int(bool(result.get("failed")))  # files of a batch
        return code, result, "" if options.json else options.text(result)
    except UsageError as error:
        return _wrong_usage(error)
    except Interrupted as error:
        return _failure(str(error), error.code)
    except BaseException as error:
        reason = reason_of(error)
        if reason is None:
            traceback.print_exc()
            reason = f"unexpected error, please report it: {type(error).__name__}: {error}"
        return _failure(reason)


def _wrong_usage(error: UsageError) -> tuple[int, dict[str, Any], str]:
    print(f"{error.usage}: error: {error}", file=sys.stderr)
    return 2, {"error": f"wrong usage: {error}"}, ""


def _failure(reason: str, code: int = 1) -> tuple[int, dict[str, Any], str]:
    flush_streams()  # so that the reason comes last
    print(f"wks_segment: {reason}", file=sys.stderr)
    return code, {"error": reason}, ""


def reason_of(error: BaseException) -> str | None:
    """What an error tells a user; None if it was not foreseen, so that only its traceback says where it is from."""
    if isinstance(error, UserError):
        return str(error)
    if isinstance(error, OSError) and error.strerror:
        name = "a file cannot be read or written" if error.filename is None else error.filename
        return f"{name}: {error.strerror}"
    if isinstance(error, MemoryError):
        return "there is not enough memory: take fewer poses or eigenpairs, or end other programs"
    return None


def _strictly(value: Any) -> Any:
    """The value without numbers that JSON does not have: null for infinity and for what is not a number."""
    if isinstance(value, dict):
        return {key: _strictly(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_strictly(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def answer(arguments: list[str]) -> Answer:
    """Run one command of a batch in this process, without output on the terminal."""
    try:
        options = _parser().parse_args(arguments)
        return Answer(_strictly(options.run(options, within_limits(Progress(), options))))
    except UsageError as error:
        return Answer(None, f"wrong usage: {error}")
    except Exception as error:
        reason = reason_of(error)
        if reason is None:
            raise
        return Answer(None, reason, is_disk_full(error))


@cache  # it takes 25 ms, as long as the rest of a refused file in a batch
def _parser() -> argparse.ArgumentParser:
    parser = _Parser(prog="wks_segment", description="The same parts, labels and colors in every pose of a character.")
    parser.add_argument("--version", action="version", version=f"%(prog)s {__version__}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    for module in COMMAND_MODULES:
        module.add(commands)
    child = commands.add_parser(CHILD_COMMAND)  # not in the help: a batch starts its children with it
    child.add_argument("folder", type=named_path)
    child.set_defaults(run=_serve, text=_no_text)
    for command in commands.choices.values():
        command.add_argument("--json", action="store_true", help="print one JSON object")
        if command.get_default("text") is None:
            command.set_defaults(text=result_text)
    return parser


def _serve(options: argparse.Namespace, progress: Progress) -> dict[str, Any]:
    """Run as the child process of a batch."""
    with handled(signal.SIG_DFL):  # the child ends at once, without an answer
        serve(options.folder, answer)
    return {}


def _no_text(result: dict[str, Any]) -> str:
    return ""
