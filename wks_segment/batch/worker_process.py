"""A child process as its parent sees it: started, watched, ended, replaced."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .errors import BatchError, EndedError
from .limits import resident
from .worker_main import READY, Answer

COMMAND = "batch-child"
"""Of the command line: hands over to `child.serve`."""
LOOK = 0.05
"""Seconds between two looks at a child."""
START_SECONDS = 180.0
"""Within which a child must be ready: Blender on a slow network drive takes its time."""
PATIENCE = 5.0
"""Seconds that a child has to end by itself when there are no more calls."""
LIFE = 100
"""Calls after which a child is replaced: what libraries do not give back is given back then."""
LAST_LINES = 3
"""Of what a child printed, for the reason of a crash."""
ONE_THREAD = {
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
    "BLIS_NUM_THREADS": "1",
    "VECLIB_MAXIMUM_THREADS": "1",
    "LP_NUM_THREADS": "1",  # Mesa's, where pictures are drawn without a graphics card
}
"""Environment of children: there is one for each core, and libraries read these when they are loaded."""


@dataclass(frozen=True)
class Program:
    """How a child is started.

    Attributes
    ----------
    command : tuple of str
        The program and its arguments, behind which comes the folder for answers.
    environment : tuple of pairs of str
        What is added to the environment.
    """

    command: tuple[str, ...]
    environment: tuple[tuple[str, str], ...] = ()


def python_program() -> Program:
    """A child by the Python that runs, with this very package."""
    # Not all of sys.path: Blender's own folders there would hide bpy from who imports it anew.
    paths = [str(Path(__file__).parents[2]), *filter(None, [os.environ.get("PYTHONPATH")])]
    return Program((sys.executable, "-m", "wks_segment", COMMAND), (("PYTHONPATH", os.pathsep.join(paths)),))


class ChildError(Exception):
    """A child is gone; the message says why. `innocent`: a fresh one might do it."""

    def __init__(self, reason: str, innocent: bool = False) -> None:
        super().__init__(reason)
        self.innocent = innocent


class Child:
    """One child process, started when it is first needed, and again after it was ended. For one thread at a time.

    Parameters
    ----------
    program : Program
    memory : float
        Bytes that it may hold.
    ended : callable
        Asked while waiting: whether the batch was ended.
    """

    def __init__(self, program: Program, memory: float, ended: Callable[[], bool]) -> None:
        self.program, self.memory, self.ended = program, memory, ended
        self._process: subprocess.Popen[bytes] | None = None
        self._folder = Path()
        self._calls = 0

    def call(self, arguments: Sequence[str], seconds: float) -> Answer:
        """Have a call answered.

        Raises
        ------
        ChildError
            If the child ended, by itself or because it took too long or too much memory.
        EndedError
            If the batch was ended meanwhile.
        BatchError
            If no child can be started at all.
        """
        if self._calls >= LIFE:
            self.close()
        process = self._process or self._start()
        self._calls += 1
        told = {"number": self._calls, "arguments": list(arguments), "seconds": seconds}
        try:
            assert process.stdin is not None
            process.stdin.write(json.dumps(told).encode() + b"\n")
            process.stdin.flush()
        except OSError:
            process.wait()  # it crashed while nothing was to do: the look below says how
        answer = self._await(process, self._folder / str(self._calls), seconds)
        return Answer(answer["result"], answer["error"])

    def close(self) -> None:
        """End the process: it has a moment to do so by itself, if it has nothing to do."""
        if self._process is None:
            return
        assert self._process.stdin is not None
        try:
            self._process.stdin.close()
            self._process.wait(PATIENCE)
        except (OSError, subprocess.TimeoutExpired):
            self._process.kill()
        self._forget()

    def kill(self) -> None:
        """End the process at once."""
        if self._process is not None:
            self._process.kill()
            self._forget()

    def _start(self) -> subprocess.Popen[bytes]:
        self._folder = Path(tempfile.mkdtemp(prefix="wks_segment_child_"))
        command = [*self.program.command, str(self._folder)]
        try:
            with open(self._folder / "printed", "wb") as printed:
                process = subprocess.Popen(
                    command, stdin=subprocess.PIPE, stdout=printed, stderr=printed,
                    env={**os.environ, **ONE_THREAD, **dict(self.program.environment)},
                    # Ctrl+C is for the parent, which ends its children.
                    start_new_session=True, creationflags=getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0),
                )  # fmt: skip
        except OSError as error:
            shutil.rmtree(self._folder, ignore_errors=True)
            raise BatchError(f"{command[0]}: it could not be started: {error.strerror or error}") from error
        self._process = process
        try:
            self._await(process, self._folder / READY, START_SECONDS)
        except ChildError as error:
            raise BatchError(f"no child process could be started by {' '.join(command[:-1])}: {error}") from error
        return process

    def _await(self, process: subprocess.Popen[bytes], answer: Path, seconds: float) -> dict[str, Any]:
        """The content of a file that a child writes."""
        until = time.monotonic() + seconds
        fresh = self._calls <= 1
        while True:
            over = process.poll() is not None
            if answer.exists():
                content: dict[str, Any] = json.loads(answer.read_text(encoding="utf-8"))
                answer.unlink()
                return content
            if over:
                reason = f"its process {_how(process.returncode)}{self._said()}"
                self._forget()
                raise ChildError(reason, innocent=not fresh)
            if self.ended():
                self.kill()
                raise EndedError
            if time.monotonic() > until:
                self.kill()
                raise ChildError(f"it took more than {seconds:g} seconds: it was ended; see --time-limit")
            if (resident(process.pid) or 0) > self.memory:
                self.kill()
                reason = f"it took more than {self.memory / 1e9:.1f} GB of memory: it was ended; see --memory-limit"
                raise ChildError(reason, innocent=not fresh)
            try:
                process.wait(LOOK)
            except subprocess.TimeoutExpired:
                continue

    def _said(self) -> str:
        """The last that it printed."""
        text = (self._folder / "printed").read_text(encoding="utf-8", errors="replace")
        lines = [line.strip() for line in text.splitlines() if line.strip()]
        return f"; it printed: {' | '.join(lines[-LAST_LINES:])}" if lines else ""

    def _forget(self) -> None:
        if self._process is not None:
            self._process.wait()
            assert self._process.stdin is not None
            # What was not read any more would be written now.
            try:
                self._process.stdin.close()
            except OSError:
                self._process.stdin = None
        self._process, self._calls = None, 0
        shutil.rmtree(self._folder, ignore_errors=True)


def _how(code: int) -> str:
    """In words, how a process ended."""
    if code >= 0:
        return f"ended with exit code {code}"
    try:
        return f"crashed ({signal.Signals(-code).name})"
    except ValueError:
        return f"crashed (signal {-code})"
