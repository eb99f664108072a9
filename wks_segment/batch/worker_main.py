"""A child process at work: takes calls of the command line, one after the other, until its parent is gone.

Calls come by standard input, a line of JSON each. Answers are files that appear whole, since Blender itself, importers
and add-ons print on standard output whenever they like.
"""

from __future__ import annotations

import faulthandler
import json
import os
import queue
import shutil
import sys
import threading
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

READY = "ready"
"""Name of the file that says that a child waits for calls."""
LATER = 1.5
"""Times of its limit after which a job is ended by its own process, should the parent not have done so."""


class Answer(NamedTuple):
    """What came of a call: its result, or why there is none."""

    result: dict[str, Any] | None
    error: str = ""


def serve(folder: Path, run: Callable[[list[str]], Answer]) -> int:
    """Answer calls until standard input ends.

    Parameters
    ----------
    folder : path
        Where answers are written, each under the number of its call.
    run : callable
        Runs one call of the command line. Whatever it raises is an answer as well.
    """
    calls: queue.SimpleQueue[str] = queue.SimpleQueue()
    threading.Thread(target=_listen, args=(calls, folder), daemon=True).start()
    _write(folder / READY, {})
    while line := calls.get():
        call = json.loads(line)
        # In C, so that it also works while a library does not let go of Python's lock.
        faulthandler.dump_traceback_later(LATER * call["seconds"] + 10, exit=True)
        try:
            answer = run(call["arguments"])
        except BaseException as error:
            traceback.print_exc()
            answer = Answer(None, f"{type(error).__name__}: {error}")
        faulthandler.cancel_dump_traceback_later()
        sys.stdout.flush()
        sys.stderr.flush()
        _write(folder / str(call["number"]), answer._asdict())
    return 0


def _listen(calls: queue.SimpleQueue[str], folder: Path) -> None:
    """Hand on calls; end the process with its parent, whatever it is doing, and leave nothing behind."""
    with open(0, encoding="utf-8", closefd=False) as lines:
        for line in lines:
            calls.put(line)
    shutil.rmtree(folder, ignore_errors=True)
    os._exit(0)


def _write(path: Path, values: dict[str, Any]) -> None:
    """Write a file that appears whole."""
    unfinished = path.with_suffix(".part")
    unfinished.write_text(json.dumps(values), encoding="utf-8")
    unfinished.replace(path)
