"""Run jobs on this machine, in several child processes, each controlled by a thread."""

from __future__ import annotations

import queue
import threading
from collections.abc import Generator, Sequence
from pathlib import Path

from .child_process import ChildProcess, Program
from .errors import BatchEndedError
from .job import Job, Outcome
from .limits import Limits
from .run_job import run_job


def run_jobs(
    jobs: Sequence[Job], program: Program, processes: int, limits: Limits, unfinished: Path
) -> Generator[Outcome]:
    """Outcome of each job as soon as it has ended. Closing the generator ends all children.

    Parameters
    ----------
    jobs
    program : Program
        Starts a child.
    processes : int
        Number of children that run at once.
    limits : Limits
    unfinished : path
        Folder in which results are written first.

    Raises
    ------
    BatchError
        If no child can be started.
    """
    waiting: queue.SimpleQueue[Job] = queue.SimpleQueue()
    for job in jobs:
        waiting.put(job)
    results: queue.SimpleQueue[Outcome | BaseException] = queue.SimpleQueue()
    ended = threading.Event()
    memory = limits.memory_of_child()

    def control_child() -> None:
        child = ChildProcess(program, memory, ended.is_set)
        try:
            while not ended.is_set():
                results.put(run_job(waiting.get_nowait(), child, limits.seconds, unfinished))
        except queue.Empty:
            child.close()
        except BatchEndedError:
            child.kill()
        except BaseException as error:
            results.put(error)
        finally:
            child.kill()

    threads = [threading.Thread(target=control_child) for _ in range(min(processes, len(jobs)))]
    try:
        for thread in threads:
            thread.start()
        for _ in jobs:
            result = _next(results)
            if isinstance(result, BaseException):
                raise result
            yield result
    finally:
        ended.set()
        for thread in threads:
            if thread.ident is not None:
                thread.join()


def _next(results: queue.SimpleQueue[Outcome | BaseException]) -> Outcome | BaseException:
    """Next item of a queue. Waits for a second at a time, since Ctrl+C on Windows does not end a longer wait."""
    while True:
        try:
            return results.get(timeout=1)
        except queue.Empty:
            continue
