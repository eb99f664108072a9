"""One job, done by a child: the same on this machine and on any other."""

from __future__ import annotations

import platform
import shutil
import tempfile
import time
from pathlib import Path

from .job import Job, Outcome
from .worker_process import Child, ChildError

KEPT = ("segments", "parts", "poses", "certainty", "rankings", "best", "verdict", "warnings", "notes")
"""Of what a command prints, what the list keeps."""


def do(job: Job, child: Child, seconds: float, unfinished: Path) -> Outcome:
    """Have a child do a job; what came of it.

    Parameters
    ----------
    job : Job
    child : Child
    seconds : float
        Limit of its time.
    unfinished : path
        A folder in which its results are written first, in one of their own.

    Raises
    ------
    EndedError, BatchError
        As `Child.call`.
    """
    begun = time.monotonic()
    # Another one each time: a machine that was taken for lost may still write.
    folder = Path(tempfile.mkdtemp(dir=unfinished, prefix=f"{job.key}-"))
    folder.chmod(0o755)
    result, reason = None, ""
    try:
        for path in job.outputs.values():
            (folder / path).parent.mkdir(parents=True, exist_ok=True)
        try:
            answer = child.call(job.call(folder), seconds)
        except ChildError as error:
            if not error.innocent:
                raise
            answer = child.call(job.call(folder), seconds)  # by a fresh process
        result, reason = answer.result, answer.error
        missing = [path for path in job.outputs.values() if not (folder / path).is_file()]
        if result is not None and missing:
            result, reason = None, f"it was not written: {', '.join(missing)}"
    except ChildError as error:
        reason = str(error)
    finally:
        if result is None:
            shutil.rmtree(folder, ignore_errors=True)
    # Names in messages are those of the batch, not of where results are written first.
    reason = reason.replace(f"{folder}/", "")
    return Outcome(
        job.input, job.name, job.key,
        status="failed" if result is None else "done",
        reason=reason,
        seconds=round(time.monotonic() - begun, 3),
        outputs={} if result is None else {**job.outputs, **_beside(folder, job)},
        place="" if result is None else folder.name,
        machine=platform.node(),
        result={name: result[name] for name in KEPT if name in result} if result else {},
    )  # fmt: skip


def _beside(folder: Path, job: Job) -> dict[str, str]:
    """What a command wrote beside its outputs, as the materials of an .obj file, by its own name."""
    paths = (path.relative_to(folder).as_posix() for path in sorted(folder.rglob("*")) if path.is_file())
    return {path: path for path in paths if path not in job.outputs.values()}
