"""A batch from its plan to its report: what is to be done, what was done before, what came of it."""

from __future__ import annotations

import shutil
import signal
import sys
import threading
import time
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from . import local_pool
from .errors import BatchError
from .html_report import write_page
from .job import Job, Outcome
from .limits import Limits, can_watch_memory
from .results_log import Record, read_record, record_name, records_in, write_record
from .worker_process import Program

UNFINISHED = ".unfinished"
"""Folder for results that are being written."""
Progress = Callable[[str, float], None]


@dataclass(frozen=True)
class Batch:
    """Jobs, and how they are to be done.

    Attributes
    ----------
    folder : path
        For results, list and report.
    jobs
        Each writes other files.
    program : Program
        Starts a child of this machine.
    processes : int
        Children at once on this machine.
    limits : Limits
    scheduler : str or None
        Address of a Dask scheduler, whose workers do the jobs.
    part : (i, n) or None
        Do only each n-th job, from the i-th on, with a list of their own.
    resume : bool
        Go on with what is in the folder.
    again : bool
        Also do what failed before.
    """

    folder: Path
    jobs: Sequence[Job]
    program: Program
    processes: int
    limits: Limits
    scheduler: str | None = None
    part: tuple[int, int] | None = None
    resume: bool = False
    again: bool = False

    def run(self, progress: Progress) -> dict[str, Any]:
        """Do what is to be done; write the list and the report.

        Raises
        ------
        BatchError
            If there is something else in the folder, if what would be written is there already, if another batch is
            at work there, if no child can be started, or if the user ends it.
        """
        self._check_folder()
        self._check_means()
        self.folder.mkdir(parents=True, exist_ok=True)
        mine = self.jobs if self.part is None else self.jobs[self.part[0] - 1 :: self.part[1]]
        name = record_name(self.part)
        # One for each list, since parts of a batch run at the same time.
        unfinished = self.folder / UNFINISHED / name
        with Record(self.folder / name) as record:
            for outcome in record.outcomes.values():  # the batch may have been killed between both
                self._put_in_place(outcome, unfinished)
            shutil.rmtree(unfinished, ignore_errors=True)
            waiting = [job for job in mine if not self._known(job, record.outcomes.get(job.input))]
            self._check_files(waiting)
            unfinished.mkdir(parents=True)
            try:
                self._do(waiting, record, len(mine), unfinished, progress)
            finally:
                shutil.rmtree(unfinished, ignore_errors=True)
                if not any((self.folder / UNFINISHED).iterdir()):
                    (self.folder / UNFINISHED).rmdir()
                known = [record.outcomes[job.input] for job in mine if job.input in record.outcomes]
                if known:
                    page = write_page(self.folder, self._all(known), len(self.jobs))
                else:  # it did not even begin: the same command may begin it
                    record.path.unlink()
        failed = {outcome.input: outcome.reason for outcome in known if not outcome.done}
        return {
            "files": len(mine), "done": len(known) - len(failed), "now": len(waiting), "failed": failed,
            "list": str(record.path), "report": str(page),
        }  # fmt: skip

    def _do(self, jobs: Sequence[Job], record: Record, of: int, unfinished: Path, progress: Progress) -> None:
        """Do jobs; what comes of each is in the list as soon as it is there."""
        begun, failures, before = time.monotonic(), 0, of - len(jobs)
        done = before
        progress(_said(done, of, 0, None, ""), done / of)
        with _ended_by_signals(), closing(self._outcomes(jobs, unfinished)) as outcomes:
            try:
                for outcome in outcomes:
                    # The list before the files: what is there without being in it is not ours.
                    record.add(outcome)
                    self._put_in_place(outcome, unfinished)
                    failures += not outcome.done
                    done += 1
                    left = (time.monotonic() - begun) / (done - before) * (of - done)
                    progress(_said(done, of, failures, left, outcome.name), done / of)
            except KeyboardInterrupt:
                raise BatchError(
                    f"ended by the user with {done} of {of} files done: go on with the same command and --resume"
                ) from None

    def _outcomes(self, jobs: Sequence[Job], unfinished: Path) -> Generator[Outcome]:
        if self.scheduler is None or not jobs:
            return local_pool.outcomes(jobs, self.program, self.processes, self.limits, unfinished)
        from . import cluster

        return cluster.outcomes(jobs, self.scheduler, self.limits, unfinished.resolve())

    def _check_means(self) -> None:
        """What is asked for can be had here."""
        if self.scheduler is not None and find_spec("distributed") is None:
            raise BatchError(
                f'--scheduler needs Dask, which is not installed in {sys.executable}: pip install "wks-segment[dask]", '
                "here and on the workers"
            )
        if self.scheduler is None and self.limits.memory is not None and not can_watch_memory():
            raise BatchError("--memory-limit needs Linux, or the package psutil")

    def _put_in_place(self, outcome: Outcome, unfinished: Path) -> None:
        """Move results to where they belong, as far as they are not there yet."""
        for path in outcome.outputs.values():
            written = unfinished / outcome.place / path
            if outcome.place and written.is_file():
                (self.folder / path).parent.mkdir(parents=True, exist_ok=True)
                written.replace(self.folder / path)

    def _known(self, job: Job, outcome: Outcome | None) -> bool:
        """Whether a job was done before, and its results are there."""
        if outcome is None or outcome.key != job.key:
            return False
        if not outcome.done:
            return not self.again
        return all((self.folder / path).is_file() for path in outcome.outputs.values())

    def _check_folder(self) -> None:
        if self.folder.exists() and not self.folder.is_dir():
            raise BatchError(f"{self.folder}: this is a file, give the name of a folder")
        there = self.folder.is_dir() and any(self.folder.iterdir())
        if there and not self.resume:
            raise BatchError(
                f"{self.folder}: the folder is not empty: take another one, or go on with the batch in it by --resume"
            )
        if there and not (records_in(self.folder) or (self.folder / UNFINISHED).is_dir()):
            raise BatchError(f"{self.folder}: there are files in the folder, but no batch that could be resumed")

    def _check_files(self, jobs: Sequence[Job]) -> None:
        """Nothing is written over but what this batch wrote."""
        known = [each for name in records_in(self.folder) for each in read_record(name).values()]
        owner = {path: outcome.input for outcome in known for path in outcome.outputs.values()}
        for job in jobs:
            for path in job.outputs.values():
                if owner.get(path, job.input) != job.input:
                    raise BatchError(
                        f"{self.folder / path}: this is what came of {owner[path]}, and {job.input} would have the "
                        "same name: take another --output for other inputs"
                    )
                if path not in owner and (self.folder / path).exists():
                    raise BatchError(
                        f"{self.folder / path}: the file is there, but not from this batch: move it away, or take "
                        "another --output"
                    )

    def _all(self, mine: Sequence[Outcome]) -> list[Outcome]:
        """What came of all files so far, those of other parts among them."""
        if self.part is None:
            return list(mine)
        found: dict[str, Outcome] = {}
        for path in records_in(self.folder):
            found |= read_record(path)
        return list(found.values())


def merged(folder: Path) -> dict[str, Any]:
    """Put the lists of all parts into one, and write the report of all; the lists of parts stay.

    Raises
    ------
    BatchError
        If there is no list.
    """
    paths = records_in(folder)
    if not paths:
        raise BatchError(f"{folder}: there is no batch in this folder")
    found: dict[str, Outcome] = {}
    for path in paths:
        found |= read_record(path)
    write_record(folder / record_name(None), found.values())
    page = write_page(folder, found.values(), len(found))
    failed = {outcome.input: outcome.reason for outcome in found.values() if not outcome.done}
    return {
        "files": len(found), "done": len(found) - len(failed), "now": 0, "failed": failed,
        "list": str(folder / record_name(None)), "report": str(page),
    }  # fmt: skip


def _said(done: int, of: int, failures: int, left: float | None, name: str) -> str:
    """How far it is."""
    failed = f", {failures} failed" if failures else ""
    rest = "" if left is None or done == of else f", {_duration(left)} left"
    return f"{done} of {of}{failed}{rest}" + (f": {name}" if name else "")


def _duration(seconds: float) -> str:
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"


@contextmanager
def _ended_by_signals() -> Iterator[None]:
    """Ctrl+C, and a request to end, as KeyboardInterrupt: Blender has its own way with the first otherwise."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    kinds = [signal.SIGINT, signal.SIGTERM]
    before = [signal.signal(kind, signal.default_int_handler) for kind in kinds]
    try:
        yield
    finally:
        for kind, handler in zip(kinds, before, strict=True):
            signal.signal(kind, signal.SIG_DFL if handler is None else handler)
