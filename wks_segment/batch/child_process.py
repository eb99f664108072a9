"""A child process as its parent sees it: it is started, given calls, watched, ended and replaced.

The processes are our own and not those of `concurrent.futures`, since a job may crash Blender, hang in an importer or
fill the memory, and must cost only its own file. A crash in a `ProcessPoolExecutor` breaks the whole pool, a job that
runs cannot be ended there, and its processes are copies of Python, not Blender programs. Of 200 files, one
broken and one that hangs, the other 198 are done; two processes are 1.98 times as fast as one (docs/batches.md).
"""

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

from ..core.files.whole_file import has_no_space
from .child_main import READY_FILE, Answer
from .errors import BatchEndedError, BatchError, disk_full_error
from .limits import resident_memory

CHILD_COMMAND = "batch-child"
"""Command of the command line that runs `child_main.serve`."""
POLL_SECONDS, POLL_SHARE = (0.002, 0.05), 0.05
"""Shortest and longest time between two checks of a child, and their share of the time that a call has taken so far."""
START_SECONDS = 180.0
"""Time limit for the start of a child; Blender on a slow network drive takes long."""
STARTS = 3
"""Most times that a child is started if it is killed before it is ready: by somebody, or because memory was short."""
EXIT_SECONDS = 5.0
"""Time that an idle child has to end by itself before it is killed."""
MAX_CALLS = 100
"""Number of calls after which a child is replaced, which frees memory that libraries never give back."""
LAST_LINES = 3
"""Number of the last printed lines of a child that are quoted in the reason of a crash."""
ONE_THREAD = {
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
    "BLIS_NUM_THREADS": "1",
    "VECLIB_MAXIMUM_THREADS": "1",
    "LP_NUM_THREADS": "1",  # Mesa, which renders pictures without a graphics card
}
"""Environment of children: each core has a child of its own, and libraries read these variables when they load."""
TEMPORARY = ("TMPDIR", "TMP", "TEMP")
"""Variables that name the folder for temporary files."""


@dataclass(frozen=True)
class Program:
    """How a child process is started.

    Attributes
    ----------
    command : tuple of str
        The program and its arguments; the folder for answers is appended.
    environment : tuple of pairs of str
        Variables that are added to the environment.
    """

    command: tuple[str, ...]
    environment: tuple[tuple[str, str], ...] = ()


def python_program() -> Program:
    """A child in the running Python, with this package."""
    # Not all of sys.path: Blender's own folders in it would hide bpy from a new import.
    paths = [str(Path(__file__).parents[2]), *filter(None, [os.environ.get("PYTHONPATH")])]
    return Program((sys.executable, "-m", "wks_segment", CHILD_COMMAND), (("PYTHONPATH", os.pathsep.join(paths)),))


class ChildError(Exception):
    """A child has ended without an answer; the message says why.

    Attributes
    ----------
    may_retry : bool
        Whether a new process might succeed, since this one had run other jobs before, or was killed before the first.
    """

    def __init__(self, reason: str, may_retry: bool = False) -> None:
        super().__init__(reason)
        self.may_retry = may_retry


class ChildProcess:
    """A child process. The first call starts it; if it has ended since, the next one starts a new one.

    Not thread-safe.

    Parameters
    ----------
    program : Program
    memory : float
        Limit of its resident memory in bytes.
    is_ended : callable
        Tells whether the batch was ended; called while waiting for an answer.
    """

    def __init__(self, program: Program, memory: float, is_ended: Callable[[], bool]) -> None:
        self.program, self.memory, self.is_ended = program, memory, is_ended
        self._process: subprocess.Popen[bytes] | None = None
        self._folder = Path()
        self._n_calls = 0

    def call(self, arguments: Sequence[str], seconds: float) -> Answer:
        """Have the child run a call of the command line.

        Raises
        ------
        ChildError
            If the child ended, by itself or because it exceeded a limit.
        BatchEndedError
            If the batch was ended meanwhile.
        BatchError
            If no child can be started at all, or its folder is full.
        """
        if self._n_calls >= MAX_CALLS:
            self.close()
        process = self._process or self._started()
        self._n_calls += 1
        call = {"number": self._n_calls, "arguments": list(arguments), "seconds": seconds}
        try:
            assert process.stdin is not None
            process.stdin.write(json.dumps(call).encode() + b"\n")
            process.stdin.flush()
        except OSError:
            process.wait()  # it crashed while it was idle: `_wait_for` reports that
        answer = self._wait_for(self._folder / str(self._n_calls), process, seconds)
        return Answer(**answer)

    def close(self) -> None:
        """Let an idle process end by itself; kill it if it does not."""
        if self._process is None:
            return
        assert self._process.stdin is not None
        try:
            self._process.stdin.close()
            self._process.wait(EXIT_SECONDS)
        except (OSError, subprocess.TimeoutExpired):
            self._process.kill()
        self._forget()

    def kill(self) -> None:
        """End the process at once."""
        if self._process is not None:
            self._process.kill()
            self._forget()

    def _started(self) -> subprocess.Popen[bytes]:
        """A new process that is ready for calls; BatchError if there is none."""
        for i in range(STARTS):
            process = self._start()
            try:
                self._wait_for(self._folder / READY_FILE, process, START_SECONDS)
                break
            except ChildError as error:
                if not error.may_retry or i == STARTS - 1:
                    command = " ".join(self.program.command)
                    raise BatchError(f"no child process could be started by {command}: {error}") from error
        return process

    def _start(self) -> subprocess.Popen[bytes]:
        self._folder = Path(tempfile.mkdtemp(prefix="wks_segment_child_"))
        command = [*self.program.command, str(self._folder)]
        try:
            with open(self._folder / "printed", "wb") as printed:
                process = subprocess.Popen(
                    command, stdin=subprocess.PIPE, stdout=printed, stderr=printed,
                    # Temporary files go with the folder, however the process ends.
                    env=os.environ | ONE_THREAD | dict.fromkeys(TEMPORARY, str(self._folder))
                    | dict(self.program.environment),
                    # Ctrl+C reaches only the parent, which ends its children.
                    start_new_session=True, creationflags=getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0),
                )  # fmt: skip
        except OSError as error:
            shutil.rmtree(self._folder, ignore_errors=True)
            raise BatchError(f"{command[0]}: it could not be started: {error.strerror or error}") from error
        self._process = process
        return process

    def _wait_for(self, answer: Path, process: subprocess.Popen[bytes], seconds: float) -> dict[str, Any]:
        """Content of a file that the child writes; ChildError or BatchEndedError if it is not written."""
        begun = time.monotonic()
        used_before = self._n_calls > 1
        while True:
            has_ended = process.poll() is not None  # before the look for the answer, which it may have written last
            if answer.exists():
                content: dict[str, Any] = json.loads(answer.read_text(encoding="utf-8"))
                answer.unlink()
                return content
            if has_ended:
                if has_no_space(self._folder):
                    raise disk_full_error(f"{self._folder}: the folder for temporary files is full")
                reason = f"its process {_describe_exit(process.returncode)}{self._printed()}"
                killed_at_start = self._n_calls == 0 and process.returncode < 0
                self._forget()
                raise ChildError(reason, may_retry=used_before or killed_at_start)
            if self.is_ended():
                self.kill()
                raise BatchEndedError
            passed = time.monotonic() - begun
            if passed > seconds:
                self.kill()
                raise ChildError(f"it took more than {seconds:g} seconds and was ended; see --time-limit")
            if resident_memory(process.pid) > self.memory:
                self.kill()
                reason = f"it took more than {self.memory / 1e9:.1f} GB of memory and was ended; see --memory-limit"
                raise ChildError(reason, may_retry=used_before)
            try:
                process.wait(min(max(POLL_SHARE * passed, POLL_SECONDS[0]), POLL_SECONDS[1]))
            except subprocess.TimeoutExpired:
                continue

    def _printed(self) -> str:
        """The last lines that the child printed, as the end of a sentence."""
        text = (self._folder / "printed").read_text(encoding="utf-8", errors="replace")
        lines = [line.strip() for line in text.splitlines() if line.strip()]
        return f"; it printed: {' | '.join(lines[-LAST_LINES:])}" if lines else ""

    def _forget(self) -> None:
        if self._process is not None:
            self._process.wait()
            assert self._process.stdin is not None
            try:
                self._process.stdin.close()  # flushes what the process did not read, which fails
            except OSError:
                self._process.stdin = None
        self._process, self._n_calls = None, 0
        shutil.rmtree(self._folder, ignore_errors=True)


def _describe_exit(code: int) -> str:
    """How a process ended, as the predicate of a sentence."""
    if code >= 0:
        return f"ended with exit code {code}"
    try:
        return f"crashed ({signal.Signals(-code).name})"
    except ValueError:
        return f"crashed (signal {-code})"
