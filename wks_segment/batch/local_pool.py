"""Jobs on this machine: as many children as are wanted, each looked after by a thread."""

from __future__ import annotations

import queue
import threading
from collections.abc import Generator, Sequence
from pathlib import Path

from .errors import EndedError
from .job import Job, Outcome
from .limits import Limits
from .run_job import do
from .worker_process import Child, Program


def outcomes(
    jobs: Sequence[Job], program: Program, processes: int, limits: Limits, unfinished: Path
) -> Generator[Outcome]:
    """What comes of each job, as soon as it is there. To close the iterator ends all children.

    Raises
    ------
    BatchError
        If children cannot be started.
    """
    waiting: queue.SimpleQueue[Job] = queue.SimpleQueue()
    for job in jobs:
        waiting.put(job)
    found: queue.SimpleQueue[Outcome | BaseException] = queue.SimpleQueue()
    ended = threading.Event()
    memory = limits.bytes()

    def look_after() -> None:
        child = Child(program, memory, ended.is_set)
        try:
            while not ended.is_set():
                found.put(do(waiting.get_nowait(), child, limits.seconds, unfinished))
        except queue.Empty:
            child.close()
        except EndedError:
            child.kill()
        except BaseException as error:
            found.put(error)
        finally:
            child.kill()

    threads = [threading.Thread(target=look_after) for _ in range(min(processes, len(jobs)))]
    try:
        for thread in threads:
            thread.start()
        for _ in jobs:
            done = _next(found)
            if isinstance(done, BaseException):
                raise done
            yield done
    finally:
        ended.set()
        for thread in threads:
            if thread.ident is not None:
                thread.join()


def _next(found: queue.SimpleQueue[Outcome | BaseException]) -> Outcome | BaseException:
    """The next in a queue. Asked again and again, since on Windows Ctrl+C does not end a wait."""
    while True:
        try:
            return found.get(timeout=1)
        except queue.Empty:
            continue
