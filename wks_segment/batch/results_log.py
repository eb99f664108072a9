"""Log of a batch: the outcome of each job, a line of JSON each, in a file that grows while the batch runs."""

from __future__ import annotations

import os
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import BinaryIO

from ..core.files.whole_file import write_whole
from .errors import BatchError
from .job import Outcome

LOG_NAME = "batch"
LOG_SUFFIX = ".jsonl"


def log_name(part: tuple[int, int] | None) -> str:
    """File name of the log of a whole batch, or of the i-th of n parts of one."""
    return LOG_NAME + ("" if part is None else f".{part[0]}-of-{part[1]}") + LOG_SUFFIX


def find_logs(folder: Path) -> list[Path]:
    """The logs in a folder: that of the whole batch, then those of its parts."""
    return sorted(folder.glob(f"{LOG_NAME}{LOG_SUFFIX}")) + sorted(folder.glob(f"{LOG_NAME}.*-of-*{LOG_SUFFIX}"))


def read_log(path: Path) -> dict[str, Outcome]:
    """Last outcome of each input in a log; incomplete lines are skipped."""
    try:
        text = path.read_text(encoding="utf-8", errors="replace")
    except FileNotFoundError:
        return {}
    outcomes = [Outcome.from_line(line) for line in text.splitlines()]
    return {outcome.input: outcome for outcome in outcomes if outcome is not None}


def read_logs(paths: Iterable[Path]) -> dict[str, Outcome]:
    """Outcome of each input in several logs; later logs prevail."""
    outcomes: dict[str, Outcome] = {}
    for path in paths:
        outcomes |= read_log(path)
    return outcomes


def write_log(path: Path, outcomes: Iterable[Outcome]) -> None:
    """Write a log anew; the file appears complete."""
    write_whole(path, "".join(f"{outcome.to_line()}\n" for outcome in outcomes))


class ResultsLog:
    """A log that is read and then appended to; a context manager that locks the file.

    An added line is on the disk before `add` returns.

    Parameters
    ----------
    path : path

    Attributes
    ----------
    outcomes : dict
        Input to its last outcome.

    Raises
    ------
    BatchError
        When it is entered while another process writes to the log.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.outcomes: dict[str, Outcome] = {}
        self._file: BinaryIO | None = None
        self._n_lines = 0

    def __enter__(self) -> ResultsLog:
        self._file = open(self.path, "a+b", buffering=0)  # closed by __exit__
        try:
            if not _lock(self._file):
                raise BatchError(f"{self.path}: another batch writes to it: wait for its end, or take another --output")
            self.outcomes = read_log(self.path)
            self._file.seek(0)
            data = self._file.read()
            self._n_lines = data.count(b"\n")
            if data and not data.endswith(b"\n"):
                self._append(b"\n")  # an incomplete line must not become the beginning of the next one
        except BaseException:
            self._file.close()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        assert self._file is not None
        if self._n_lines > len(self.outcomes):
            with suppress(OSError):  # the longer log says the same
                write_log(self.path, self.outcomes.values())  # one line for each file, which is easier to read
        self._file.close()

    def add(self, outcome: Outcome) -> None:
        """Append the outcome of a job, which replaces earlier ones of the same input; OSError if that fails."""
        self._append(f"{outcome.to_line()}\n".encode())
        self._n_lines += 1
        self.outcomes[outcome.input] = outcome

    def _append(self, line: bytes) -> None:
        """Add a line to the file, all of it or nothing."""
        assert self._file is not None
        size = self._file.seek(0, os.SEEK_END)
        try:
            while line:  # a disk that is nearly full takes a piece of it first
                line = line[self._file.write(line) :]
            os.fsync(self._file.fileno())
        except OSError as error:
            self._file.truncate(size)
            error.filename = error.filename or str(self.path)
            raise


def _lock(file: BinaryIO) -> bool:
    """Lock a file until it is closed; False if another process holds the lock. Windows has no such lock."""
    try:
        import fcntl
    except ImportError:
        return True
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True
