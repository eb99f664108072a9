"""The list of a batch: what came of each file, in a file of JSON lines that grows as the batch goes on."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path
from types import TracebackType
from typing import TextIO

from .errors import BatchError
from .job import Outcome

NAME = "batch"
SUFFIX = ".jsonl"


def record_name(part: tuple[int, int] | None) -> str:
    """Of the list of a whole batch, or of a part of it."""
    return NAME + ("" if part is None else f".{part[0]}-of-{part[1]}") + SUFFIX


def records_in(folder: Path) -> list[Path]:
    """The lists in a folder: of the whole batch, of its parts."""
    return sorted(folder.glob(f"{NAME}{SUFFIX}")) + sorted(folder.glob(f"{NAME}.*-of-*{SUFFIX}"))


def read_record(path: Path) -> dict[str, Outcome]:
    """Input to what came of it, the last line of each; lines that were not written to their end count as none."""
    try:
        text = path.read_text(encoding="utf-8", errors="replace")
    except FileNotFoundError:
        return {}
    found = [Outcome.of_line(line) for line in text.splitlines()]
    return {outcome.input: outcome for outcome in found if outcome is not None}


class Record:
    """A list that is being written: what was in it, and what is added, which is on the disk before `add` returns.

    Only one process writes to a list.

    Parameters
    ----------
    path : path

    Attributes
    ----------
    outcomes : dict
        Input to what came of it.

    Raises
    ------
    BatchError
        If another process does so.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.outcomes: dict[str, Outcome] = {}
        self._file: TextIO | None = None
        self._lines = 0

    def __enter__(self) -> Record:
        self._file = open(self.path, "a+", encoding="utf-8", errors="replace")  # closed at exit
        if not _locked(self._file):
            self._file.close()
            raise BatchError(f"{self.path}: another batch is at work on it: wait for its end, or take another --output")
        self.outcomes = read_record(self.path)
        self._file.seek(0)
        text = self._file.read()
        self._lines = len(text.splitlines())
        if text and not text.endswith("\n"):
            self._file.write("\n")  # a line that was not written to its end stays one that counts as none
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        assert self._file is not None
        if self._lines > len(self.outcomes):
            write_record(self.path, self.outcomes.values())  # one line a file, for who reads it
        self._file.close()

    def add(self, outcome: Outcome) -> None:
        """Write a line; the last of a file is the one that counts."""
        assert self._file is not None
        self._file.write(f"{outcome.line()}\n")
        self._file.flush()
        os.fsync(self._file.fileno())
        self._lines += 1
        self.outcomes[outcome.input] = outcome


def write_record(path: Path, outcomes: Iterable[Outcome]) -> None:
    """Write a list anew; it appears whole."""
    unfinished = path.with_suffix(".part")
    unfinished.write_text("".join(f"{outcome.line()}\n" for outcome in outcomes), encoding="utf-8")
    unfinished.replace(path)


def _locked(file: TextIO) -> bool:
    """Lock a file until it is closed; False if another process has done so. Not on Windows, which has no such lock."""
    try:
        import fcntl
    except ImportError:
        return True
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True
