"""Jobs on many machines, by Dask: the same jobs in the same children, which the workers of a cluster look after.

A worker that dies takes nothing with it: its jobs are done anew by others. All machines see the same files under the
same paths. Only this module imports Dask, and it is imported only if a scheduler is given.
"""

from __future__ import annotations

import queue
import threading
import uuid
from collections.abc import Generator, Sequence
from pathlib import Path

from distributed import Client, KilledWorker, Worker, WorkerPlugin, as_completed, get_worker

from .errors import BatchError, EndedError
from .job import Job, Outcome
from .limits import Limits
from .run_job import do
from .worker_process import Child, python_program

CONNECT_SECONDS = 10
RETRIES = 2
"""Times that a job is done anew after its worker could not even begin it, as where the folder is not mounted."""


def outcomes(jobs: Sequence[Job], scheduler: str, limits: Limits, unfinished: Path) -> Generator[Outcome]:
    """What comes of each job, as soon as it is there. To close the iterator ends all children.

    Parameters
    ----------
    scheduler : str
        Address of a Dask scheduler, `tcp://host:port`.

    Raises
    ------
    BatchError
        If there is no scheduler.
    """
    try:
        client = Client(scheduler, timeout=CONNECT_SECONDS, set_as_default=False)
    except (OSError, TimeoutError, ValueError) as error:
        raise BatchError(f"{scheduler}: no Dask scheduler answers there: {error}") from error
    name = f"wks_segment-{uuid.uuid4().hex}"
    with client, client.as_current():
        client.register_plugin(_Children(name, limits), name=name)
        try:
            futures = {
                client.submit(
                    _do, job, limits.seconds, str(unfinished), name,
                    key=f"wks_segment-{job.key}-{uuid.uuid4().hex}", retries=RETRIES, pure=False,
                ): job
                for job in jobs
            }  # fmt: skip
            # Forgotten as they come, or the scheduler would keep all of them.
            for future in as_completed(list(futures)):
                job = futures.pop(future)
                problem = future.exception()
                yield future.result() if problem is None else _lost(job, problem)
                future.release()
        finally:
            # What is at work ends with the children.
            client.unregister_worker_plugin(name)


def _do(job: Job, seconds: float, unfinished: str, plugin: str) -> Outcome:
    """Runs on a worker, in one of its threads."""
    children = get_worker().plugins[plugin]
    assert isinstance(children, _Children)
    return children.do(job, seconds, Path(unfinished))


def _lost(job: Job, error: BaseException) -> Outcome:
    """A job that no worker finished."""
    reason = f"no worker finished it: {type(error).__name__}: {error}".partition("\n")[0]
    if isinstance(error, KilledWorker):
        reason = "each worker that began it died, and it is not tried again; do their machines have enough memory?"
    return Outcome(job.input, job.name, job.key, "failed", reason)


class _Children(WorkerPlugin):
    """The children of one worker, in a batch: a plugin of Dask, which sets it up on each worker that there is or comes.

    As many children as jobs are at work at once, which is the number of the worker's threads.
    """

    def __init__(self, name: str, limits: Limits) -> None:
        self.name, self.limits = name, limits

    def setup(self, worker: Worker) -> None:
        """Called by Dask on the worker."""
        self._ended = threading.Event()
        self._free: queue.SimpleQueue[Child] = queue.SimpleQueue()
        self._memory = self.limits.bytes()

    def teardown(self, worker: Worker) -> None:
        """Called by Dask when the batch or the worker ends."""
        self._ended.set()
        while not self._free.empty():
            self._free.get().kill()

    def do(self, job: Job, seconds: float, unfinished: Path) -> Outcome:
        """See `work.do`."""
        try:
            child = self._free.get_nowait()  # other threads of the worker take from it, too
        except queue.Empty:
            child = Child(python_program(), self._memory, self._ended.is_set)
        try:
            return do(job, child, seconds, unfinished)
        except EndedError:
            child.kill()
            raise
        finally:
            if self._ended.is_set():
                child.kill()
            self._free.put(child)
