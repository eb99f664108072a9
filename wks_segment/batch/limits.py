"""Limits of a job's time and memory, and the memory that a process holds."""

from __future__ import annotations

from dataclasses import dataclass

import psutil

from ..core.spectral.memory import available_memory

SHARE_OF_FREE_MEMORY = 0.9
"""Share of the free memory that a child may hold if no limit is given: a child that fills the memory is ended before
the system ends one process or another."""


@dataclass(frozen=True)
class Limits:
    """Limits of a job, which is ended when it exceeds one of them.

    Attributes
    ----------
    seconds : float
    memory : int or None
        Bytes of resident memory of a child. None: 0.9 of the memory that is free on its machine when the batch begins
        there.
    """

    seconds: float
    memory: int | None = None

    def memory_of_child(self) -> float:
        """Bytes that a child on this machine may hold."""
        return SHARE_OF_FREE_MEMORY * available_memory() if self.memory is None else self.memory


def resident_memory(pid: int) -> int:
    """Bytes of resident memory of a process; 0 if it has ended."""
    try:
        return int(psutil.Process(pid).memory_info().rss)
    except psutil.Error:
        return 0
