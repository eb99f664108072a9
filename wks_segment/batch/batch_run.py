"""One run of a batch: select the jobs that are not done, run them, log the results and write the report."""

from __future__ import annotations

import shutil
import sys
import time
from collections.abc import Generator, Sequence
from contextlib import closing, suppress
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from ..core.files.whole_file import UNFINISHED_PREFIX, is_disk_full
from ..core.progress import Progress
from ..interruption import Interrupted
from . import local_pool
from .child_process import Program
from .errors import BatchError, disk_full_error
from .html_report import REPORT_NAME, write_report
from .job import Job, Outcome
from .limits import Limits
from .results_log import ResultsLog, find_logs, log_name, read_log, read_logs, write_log

UNFINISHED_FOLDER = ".unfinished"
"""Folder, within that of the batch, in which results are written before they are moved to their place."""


@dataclass(frozen=True)
class Batch:
    """Jobs, and how they are run.

    Attributes
    ----------
    folder : path
        Folder for results, log and report.
    jobs
        No two of them write the same file.
    program : Program
        Starts a child process on this machine.
    processes : int
        Number of child processes on this machine that run at once.
    limits : Limits
    scheduler : str or None
        Address of a Dask scheduler, whose workers run the jobs.
    part : (i, n) or None
        Run only every n-th job, beginning with the i-th, and keep a log of these alone.
    resume : bool
        Continue the batch in the folder.
    retry : bool
        With `resume`, run jobs that failed again.
    """

    folder: Path
    jobs: Sequence[Job]
    program: Program
    processes: int
    limits: Limits
    scheduler: str | None = None
    part: tuple[int, int] | None = None
    resume: bool = False
    retry: bool = False

    def run(self, progress: Progress) -> dict[str, Any]:
        """Run the jobs that are not done yet; write the log and the report.

        Returns
        -------
        dict
            Number of files, of those that are done, and of those that were run now; input and reason of those that
            failed; paths of the log ("list") and the report.

        Raises
        ------
        BatchError
            If the folder contains anything else or cannot be written to, if a file that would be written exists
            already, if another batch is running in the folder, if no child process can be started, or if the disk is
            full.
        Interrupted
            If a signal ends the batch.
        """
        try:
            return self._run(progress)
        except OSError as error:
            raise self._not_written(error) from error

    def _run(self, progress: Progress) -> dict[str, Any]:
        self._check_folder()
        self._check_requirements()
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise BatchError(
                f"{self.folder}: the folder cannot be made: {error.strerror}: take another --output"
            ) from error
        jobs = self.jobs if self.part is None else self.jobs[self.part[0] - 1 :: self.part[1]]
        name = log_name(self.part)
        # A folder for each log, since parts of a batch run at the same time.
        unfinished = self.folder / UNFINISHED_FOLDER / name
        with ResultsLog(self.folder / name) as log:
            for outcome in log.outcomes.values():  # a batch may have been killed before it moved these results
                self._move_results(outcome, unfinished)
            self._remove_unfinished(jobs, unfinished)
            waiting = [job for job in jobs if not self._is_finished(job, log.outcomes.get(job.input))]
            self._check_outputs(waiting)
            unfinished.mkdir(parents=True)
            try:
                self._run_jobs(waiting, log, len(jobs), unfinished, progress)
            except BaseException:
                with suppress(OSError):  # the first error is the reason
                    self._finish(jobs, log, unfinished)
                raise
            finished, report = self._finish(jobs, log, unfinished)
        return _summary(finished, len(jobs), len(waiting), log.path, report)

    def _finish(self, jobs: Sequence[Job], log: ResultsLog, unfinished: Path) -> tuple[list[Outcome], Path]:
        """Remove the temporary folder and write the report; outcomes of the jobs, and path of the report."""
        self._remove_unfinished(jobs, unfinished)
        with suppress(OSError):  # other parts of the batch have theirs in it
            (self.folder / UNFINISHED_FOLDER).rmdir()
        finished = [log.outcomes[job.input] for job in jobs if job.input in log.outcomes]
        if finished:
            write_report(self.folder, self._with_other_parts(finished), len(self.jobs))
        else:  # leave no log, so that the same command may start the batch again
            log.path.unlink()
        return finished, self.folder / REPORT_NAME

    def _not_written(self, error: OSError) -> BatchError:
        """The error of a batch that could not write to its folder."""
        reason = f"{error.filename or self.folder}: {error.strerror or error}"
        if is_disk_full(error):
            return disk_full_error(reason)
        if not self.folder.is_dir() and isinstance(error, FileNotFoundError):
            return BatchError(f"{self.folder}: the folder was deleted while the batch was running")
        return BatchError(f"{reason}: take another --output, or make this folder writable")

    def _run_jobs(
        self, jobs: Sequence[Job], log: ResultsLog, n_files: int, unfinished: Path, progress: Progress
    ) -> None:
        """Run jobs; the outcome of each is logged at once."""
        n_before = n_done = n_files - len(jobs)
        begun, n_failed = time.monotonic(), 0
        with closing(self._outcomes(jobs, unfinished)) as outcomes:
            try:
                progress(n_done / n_files, _progress_text(n_done, n_files))
                for outcome in outcomes:
                    # First the log, then the files: a file that is in no log counts as somebody else's.
                    log.add(outcome)
                    self._move_results(outcome, unfinished)
                    n_failed += not outcome.done
                    n_done += 1
                    seconds_left = (time.monotonic() - begun) / (n_done - n_before) * (n_files - n_done)
                    text = _progress_text(n_done, n_files, n_failed, seconds_left)
                    progress(n_done / n_files, f"{text}: {outcome.name}")
            except Interrupted as end:
                state = f", with {n_done} of {n_files} files done: continue with the same command and --resume"
                raise Interrupted(end.number, state) from None

    def _outcomes(self, jobs: Sequence[Job], unfinished: Path) -> Generator[Outcome]:
        """Outcome of each job as soon as it has ended, in any order."""
        if self.scheduler is None or not jobs:
            return local_pool.run_jobs(jobs, self.program, self.processes, self.limits, unfinished)
        from . import dask_cluster

        return dask_cluster.run_jobs(jobs, self.scheduler, self.limits, unfinished.resolve())

    def _check_requirements(self) -> None:
        if self.part is not None and self.part[0] > len(self.jobs):
            i, n = self.part
            raise BatchError(f"--part {i}/{n}: there are only {len(self.jobs)} files")
        if self.scheduler is not None and find_spec("distributed") is None:
            raise BatchError(
                f'--scheduler needs Dask, which is not installed in {sys.executable}: pip install ".[dask]", '
                "here and on the workers"
            )

    def _remove_unfinished(self, jobs: Sequence[Job], unfinished: Path) -> None:
        """Remove the temporary folder, and files that killed children left in the places of scenes."""
        shutil.rmtree(unfinished, ignore_errors=True)
        keys = {job.key for job in jobs}  # other parts of the batch may be writing to the same places
        for place in filter(None, {job.place_of_scene(self.folder) for job in jobs}):
            for left in place.glob(f"{UNFINISHED_PREFIX}*"):
                if left.name.removeprefix(UNFINISHED_PREFIX).partition("-")[0] in keys:
                    left.unlink(missing_ok=True)

    def _move_results(self, outcome: Outcome, unfinished: Path) -> None:
        """Move the results of a job that are still in their temporary folder to their place."""
        for path in outcome.outputs.values():
            written = unfinished / outcome.place / path
            if outcome.place and written.is_file():
                (self.folder / path).parent.mkdir(parents=True, exist_ok=True)
                written.replace(self.folder / path)

    def _is_finished(self, job: Job, outcome: Outcome | None) -> bool:
        """Whether a job needs no run: it was run with the same input and settings, and its results are still there."""
        if outcome is None or outcome.key != job.key:
            return False
        if not outcome.done:
            return not self.retry
        return all((self.folder / path).is_file() for path in outcome.outputs.values())

    def _check_folder(self) -> None:
        if self.folder.is_symlink() and not self.folder.exists():
            raise BatchError(f"{self.folder}: this is a link to a folder that does not exist: make that folder first")
        if self.folder.exists() and not self.folder.is_dir():
            raise BatchError(f"{self.folder}: this is a file; give the name of a folder")
        used = self.folder.is_dir() and any(self.folder.iterdir())
        if used and not self.resume:
            raise BatchError(
                f"{self.folder}: the folder is not empty: take another one, or continue the batch in it with --resume"
            )
        if used and not (find_logs(self.folder) or (self.folder / UNFINISHED_FOLDER).is_dir()):
            raise BatchError(f"{self.folder}: there are files in the folder, but no batch that could be continued")

    def _check_outputs(self, jobs: Sequence[Job]) -> None:
        """Refuse to overwrite files, except those that this batch wrote for the same input."""
        logged = [outcome for path in find_logs(self.folder) for outcome in read_log(path).values()]
        owner = {path: outcome.input for outcome in logged for path in outcome.outputs.values()}
        for job in jobs:
            for path in job.outputs.values():
                if owner.get(path, job.input) != job.input:
                    raise BatchError(
                        f"{self.folder / path}: this is the result of {owner[path]}, and that of {job.input} would "
                        "have the same name: take another --output for other inputs"
                    )
                if path not in owner and (self.folder / path).exists():
                    raise BatchError(
                        f"{self.folder / path}: the file exists and is not from this batch: move it away, or take "
                        "another --output"
                    )

    def _with_other_parts(self, finished: Sequence[Outcome]) -> list[Outcome]:
        """Outcomes of the whole batch so far, for which the logs of other parts are read."""
        return list(finished) if self.part is None else list(read_logs(find_logs(self.folder)).values())


def merge_logs(folder: Path) -> dict[str, Any]:
    """Merge the logs of all parts of a batch into one, and write the report; the logs of the parts stay.

    Returns
    -------
    dict
        As that of `Batch.run`.

    Raises
    ------
    BatchError
        If there is no log in the folder.
    """
    paths = find_logs(folder)
    if not paths:
        raise BatchError(f"{folder}: there is no batch in this folder")
    outcomes = list(read_logs(paths).values())
    merged = folder / log_name(None)
    write_log(merged, outcomes)
    report = write_report(folder, outcomes, len(outcomes))
    return _summary(outcomes, len(outcomes), 0, merged, report)


def _summary(outcomes: Sequence[Outcome], n_files: int, n_run: int, log: Path, report: Path) -> dict[str, Any]:
    failed = {outcome.input: outcome.reason for outcome in outcomes if not outcome.done}
    return {
        "files": n_files, "done": len(outcomes) - len(failed), "now": n_run, "failed": failed,
        "list": str(log), "report": str(report),
    }  # fmt: skip


def _progress_text(n_done: int, n_files: int, n_failed: int = 0, seconds_left: float | None = None) -> str:
    failed = f", {n_failed} failed" if n_failed else ""
    left = "" if seconds_left is None or n_done == n_files else f", {_duration(seconds_left)} left"
    return f"{n_done} of {n_files}{failed}{left}"


def _duration(seconds: float) -> str:
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"
