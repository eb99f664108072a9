"""Main loop of a child process: runs calls of the command line, one after the other, until its parent is gone.

Calls arrive on standard input, a line of JSON each. Answers are files that appear complete. They are not sent on
standard output, since Blender, importers and add-ons print there at any time.
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

READY_FILE = "ready"
"""Name of the file by which a child says that it is ready for calls."""
SELF_END_FACTOR = 1.5
"""A child whose parent failed to end it in time ends itself after this multiple of the time limit, plus 10 seconds."""


class Answer(NamedTuple):
    """Result of a call, or the reason why there is none, and whether it is that the disk is full."""

    result: dict[str, Any] | None
    error: str = ""
    disk_full: bool = False


def serve(folder: Path, run: Callable[[list[str]], Answer]) -> int:
    """Answer calls until standard input ends.

    Parameters
    ----------
    folder : path
        Folder for the answers; the name of each is the number of its call.
    run : callable
        Runs one call of the command line. An error that it raises is sent as an answer.

    Returns
    -------
    int
        Exit code of the process.
    """
    calls: queue.SimpleQueue[str] = queue.SimpleQueue()
    threading.Thread(target=_read_calls, args=(calls, folder), daemon=True).start()
    _write(folder / READY_FILE, {})
    while line := calls.get():
        call = json.loads(line)
        # faulthandler works in C, so it can end the process even while a library holds the interpreter lock.
        faulthandler.dump_traceback_later(SELF_END_FACTOR * call["seconds"] + 10, exit=True)
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


def _read_calls(calls: queue.SimpleQueue[str], folder: Path) -> None:
    """Pass calls on; when standard input ends with the parent, remove the folder and end the process at once."""
    with open(0, encoding="utf-8", closefd=False) as lines:
        for line in lines:
            calls.put(line)
    shutil.rmtree(folder, ignore_errors=True)
    os._exit(0)


def _write(path: Path, values: dict[str, Any]) -> None:
    """Write a file of JSON that appears complete."""
    unfinished = path.with_suffix(".part")
    unfinished.write_text(json.dumps(values), encoding="utf-8")
    unfinished.replace(path)
