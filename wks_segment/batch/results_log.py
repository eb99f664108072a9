"""Log of a batch: the outcome of each job, a line of JSON each, in a file that grows while the batch runs."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path
from types import TracebackType
from typing import TextIO

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
        self._file: TextIO | None = None
        self._n_lines = 0

    def __enter__(self) -> ResultsLog:
        self._file = open(self.path, "a+", encoding="utf-8", errors="replace")  # closed by __exit__
        if not _lock(self._file):
            self._file.close()
            raise BatchError(f"{self.path}: another batch writes to it: wait for its end, or take another --output")
        self.outcomes = read_log(self.path)
        self._file.seek(0)
        text = self._file.read()
        self._n_lines = len(text.splitlines())
        if text and not text.endswith("\n"):
            self._file.write("\n")  # an incomplete line must not become the beginning of the next one
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        assert self._file is not None
        if self._n_lines > len(self.outcomes):
            write_log(self.path, self.outcomes.values())  # one line for each file, which is easier to read
        self._file.close()

    def add(self, outcome: Outcome) -> None:
        """Append the outcome of a job; it replaces earlier ones of the same input."""
        assert self._file is not None
        self._file.write(f"{outcome.to_line()}\n")
        self._file.flush()
        os.fsync(self._file.fileno())
        self._n_lines += 1
        self.outcomes[outcome.input] = outcome


def _lock(file: TextIO) -> bool:
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
