"""Run one job in a child process, on this machine or on that of a Dask worker."""

from __future__ import annotations

import platform
import shutil
import tempfile
import time
from pathlib import Path

from ..core.files.whole_file import has_no_space
from .child_main import Answer
from .child_process import ChildError, ChildProcess
from .errors import disk_full_error
from .job import Job, Outcome

LOGGED_FIELDS = ("segments", "parts", "poses", "certainty", "rankings", "best", "verdict", "warnings", "notes")
"""Fields of a command's result that are logged."""


def run_job(job: Job, child: ChildProcess, seconds: float, unfinished: Path) -> Outcome:
    """Run a job in a child process.

    Parameters
    ----------
    job : Job
    child : ChildProcess
    seconds : float
        Time limit.
    unfinished : path
        Folder in which a new folder is made for the results; two levels below the folder of the batch.

    Raises
    ------
    BatchEndedError, BatchError
        As `ChildProcess.call` does.
    DiskFullError
        If the job failed because the disk is full, as all others would.
    """
    begun = time.monotonic()
    # A new folder for each run: a machine that is believed dead may still write to its own.
    folder = Path(tempfile.mkdtemp(dir=unfinished, prefix=f"{job.key}-"))
    folder.chmod(0o755)
    result, reason = None, ""
    try:
        for path in job.outputs.values():
            (folder / path).parent.mkdir(parents=True, exist_ok=True)
        place = job.place_of_scene(unfinished.parents[1])
        if place is not None:
            place.mkdir(parents=True, exist_ok=True)
        result, reason, disk_full = _call(child, job.arguments_for(folder, place), seconds)
        if result is None and (disk_full or has_no_space(folder)):
            raise disk_full_error(reason.replace(f"{folder}/", ""))
        missing = [path for path in job.outputs.values() if not (folder / path).is_file()]
        if result is not None and missing:
            result, reason = None, f"it was not written: {', '.join(missing)}"
    except ChildError as error:
        reason = str(error)
    finally:
        if result is None:
            shutil.rmtree(folder, ignore_errors=True)
    return Outcome(
        job.input, job.name, job.key,
        status="failed" if result is None else "done",
        reason=reason.replace(f"{folder}/", ""),  # paths relative to the folder of the batch
        seconds=round(time.monotonic() - begun, 3),
        outputs={} if result is None else {**job.outputs, **_other_outputs(folder, job)},
        place="" if result is None else folder.name,
        machine=platform.node(),
        result={name: result[name] for name in LOGGED_FIELDS if name in result} if result else {},
    )  # fmt: skip


def _call(child: ChildProcess, arguments: list[str], seconds: float) -> Answer:
    """Answer of a child to a call; asked again if the first process ended after it had answered others."""
    try:
        return child.call(arguments, seconds)
    except ChildError as error:
        if not error.may_retry:
            raise
    return child.call(arguments, seconds)


def _other_outputs(folder: Path, job: Job) -> dict[str, str]:
    """Files that a command wrote beside its outputs, such as the .mtl of an .obj file, under their own names."""
    paths = (path.relative_to(folder).as_posix() for path in sorted(folder.rglob("*")) if path.is_file())
    return {path: path for path in paths if path not in job.outputs.values()}
