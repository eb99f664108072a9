"""What a job may take."""

from __future__ import annotations

import os
import sys
from dataclasses import dataclass
from pathlib import Path

from ..core.spectral.memory import available_memory

OF_FREE = 0.9
"""Share of the memory that is free at first which a child may take, if nothing else is said: before the system has to
end a process, and perhaps another one, the one that takes it all is ended."""


@dataclass(frozen=True)
class Limits:
    """What a job may take before it is ended.

    Attributes
    ----------
    seconds : float
    memory : int or None
        Bytes of a child, resident; None: 0.9 of what is free on its machine when the batch begins there.
    """

    seconds: float
    memory: int | None = None

    def bytes(self) -> float:
        """Of a child on this machine."""
        if self.memory is not None:
            return self.memory
        free = available_memory()
        return float("inf") if free is None else OF_FREE * free


def can_watch_memory() -> bool:
    """Whether `resident` knows anything here."""
    return resident(os.getpid()) is not None


def resident(pid: int) -> int | None:
    """Bytes of memory that a process holds; None if it is not there, or where that cannot be told.

    From the system itself on Linux, elsewhere from psutil, if that is installed (Dask brings it).
    """
    if sys.platform == "linux":
        try:
            pages = int(Path(f"/proc/{pid}/statm").read_text(encoding="ascii").split()[1])
        except (OSError, IndexError):
            return None
        return pages * os.sysconf("SC_PAGE_SIZE")
    try:
        import psutil
    except ImportError:
        return None
    try:
        return int(psutil.Process(pid).memory_info().rss)
    except psutil.Error:
        return None
