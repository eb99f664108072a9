"""Run jobs on many machines with Dask, whose workers start the same child processes as a local batch.

If a worker dies, other workers run its jobs again. All machines must see the files under the same paths. Dask is
imported only here, and this module is imported only if a scheduler is given.
"""

from __future__ import annotations

import logging
import queue
import threading
import time
import uuid
from collections.abc import Generator, Sequence
from contextlib import suppress
from pathlib import Path

from dask.typing import Key
from distributed import Client, KilledWorker, Worker, WorkerPlugin, as_completed, get_worker

from .child_process import ChildProcess, python_program
from .errors import BatchEndedError, BatchError, DiskFullError
from .job import Job, Outcome
from .limits import Limits
from .run_job import run_job

IDLE_SECONDS = 20.0
"""Time after its last job after which a worker ends its idle children: the batch may have been killed."""
CONNECT_SECONDS = 10
"""Time limit for the connection to the scheduler."""
RETRIES = 2
"""Number of times that a job is tried again after a worker could not start it, as where the folder is not mounted."""


def run_jobs(jobs: Sequence[Job], scheduler: str, limits: Limits, unfinished: Path) -> Generator[Outcome]:
    """Outcome of each job as soon as it has ended. Closing the generator ends all children.

    Parameters
    ----------
    jobs
    scheduler : str
        Address of a Dask scheduler, `tcp://host:port`.
    limits : Limits
    unfinished : path
        Folder in which results are written first, the same on all machines.

    Raises
    ------
    BatchError
        If the scheduler does not answer, or the disk is full.
    """
    # Errors are told by the batch; Dask would print the tracebacks of a connection that it gives up as well.
    logging.getLogger("distributed.client").setLevel(logging.CRITICAL)
    try:
        client = Client(scheduler, timeout=CONNECT_SECONDS, set_as_default=False)
    except (OSError, TimeoutError, ValueError) as error:
        raise BatchError(f"{scheduler}: no Dask scheduler answers there: {error}") from error
    name = f"wks_segment-{uuid.uuid4().hex}"
    with client, client.as_current():
        client.register_plugin(_ChildrenPlugin(name, limits), name=name)
        try:
            futures = {
                client.submit(
                    _run_on_worker, job, limits.seconds, str(unfinished), name,
                    key=f"wks_segment-{job.key}-{uuid.uuid4().hex}", retries=RETRIES, pure=False,
                ): job
                for job in jobs
            }  # fmt: skip
            for future in as_completed(list(futures)):
                job = futures.pop(future)
                if future.cancelled() or client.status != "running":
                    raise BatchError(
                        f"{scheduler}: the Dask scheduler does not answer any more: start it again, and continue with "
                        "the same command and --resume"
                    )
                failure = future.exception()
                if isinstance(failure, DiskFullError):
                    raise failure
                yield future.result() if failure is None else _lost(job, failure)
                future.release()  # or the scheduler would keep all results
        finally:
            with suppress(OSError):  # the scheduler may have died
                client.unregister_worker_plugin(name)  # this ends the children, and with them all running jobs


def _run_on_worker(job: Job, seconds: float, unfinished: str, plugin: str) -> Outcome:
    """Run a job; called by Dask on a worker, in one of its threads."""
    children = get_worker().plugins[plugin]
    assert isinstance(children, _ChildrenPlugin)
    return children.run(job, seconds, Path(unfinished))


def _lost(job: Job, error: BaseException) -> Outcome:
    """Outcome of a job that no worker finished."""
    reason = f"no worker finished it: {type(error).__name__}: {error}".partition("\n")[0]
    if isinstance(error, KilledWorker):
        reason = "each worker that started it died, so it is not tried again; do their machines have enough memory?"
    return Outcome(job.input, job.name, job.key, "failed", reason)


class _ChildrenPlugin(WorkerPlugin):
    """Child processes of one Dask worker during a batch; Dask installs the plugin on each present or future worker.

    There are as many children as jobs that run at once, which is the number of threads of the worker. A batch that is
    killed cannot take the plugin back: Dask then cancels its jobs, and children end with them or after a while.
    """

    def __init__(self, name: str, limits: Limits) -> None:
        self.name, self.limits = name, limits

    def setup(self, worker: Worker) -> None:
        """Prepare the worker; called by Dask."""
        self._worker = worker
        self._ended = threading.Event()
        self._last = time.monotonic()
        self._idle: queue.SimpleQueue[ChildProcess] = queue.SimpleQueue()
        self._memory = self.limits.memory_of_child()

    def teardown(self, worker: Worker) -> None:
        """End all children; called by Dask when the batch or the worker ends."""
        self._ended.set()
        self._end_idle()

    def run(self, job: Job, seconds: float, unfinished: Path) -> Outcome:
        """Run a job in an idle child or in a new one; see `run_job`."""
        try:
            child = self._idle.get_nowait()
        except queue.Empty:
            child = ChildProcess(python_program(), self._memory, self._ended.is_set)
        key = self._worker.get_current_task()
        child.is_ended = lambda: self._ended.is_set() or self._is_canceled(key)
        try:
            return run_job(job, child, seconds, unfinished)
        except BatchEndedError:
            child.kill()
            raise
        finally:
            if self._ended.is_set():
                child.kill()
            self._idle.put(child)
            self._last = time.monotonic()
            self._worker.loop.add_callback(self._worker.loop.call_later, IDLE_SECONDS, self._end_if_unused)

    def _is_canceled(self, key: Key) -> bool:
        """Whether Dask has given up a job that is running here, since nobody waits for it any more."""
        task = self._worker.state.tasks.get(key)
        return task is None or task.state == "cancelled"

    def _end_if_unused(self) -> None:
        """End idle children if there was no job for a while."""
        if time.monotonic() - self._last >= IDLE_SECONDS:
            self._end_idle()

    def _end_idle(self) -> None:
        with suppress(queue.Empty):
            while True:
                self._idle.get_nowait().kill()
