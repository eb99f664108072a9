"""Limits of time and memory that hold for all that a command does, beside the estimate before a job."""

from __future__ import annotations

import argparse
import os
import time

from ...batch.limits import resident_memory
from ...core.progress import Progress, ReportFunction
from ..errors import TooLargeError


def within_limits(progress: Progress, options: argparse.Namespace) -> Progress:
    """The same progress, which ends a command that takes more than `--limit-minutes` or `--limit-memory`.

    Only if they were given: their defaults limit the estimate alone, since a slow machine may take longer.
    """
    minutes, memory = getattr(options, "limit_minutes", None), getattr(options, "limit_memory", None)
    return Progress(_Limited(progress.report, minutes, memory)) if minutes or memory else progress


class _Limited:
    """Report that raises an error beyond a limit.

    Parameters
    ----------
    report : callable
    minutes, memory : float or None
        Limits in minutes from now on, and in GB besides what the process holds now.
    """

    def __init__(self, report: ReportFunction, minutes: float | None, memory: float | None) -> None:
        self._report, self._minutes, self._memory = report, minutes, memory
        self._begun, self._held = time.monotonic(), resident_memory(os.getpid())

    def __call__(self, stage: str, share: float) -> None:
        if self._minutes and time.monotonic() - self._begun > 60 * self._minutes:
            raise TooLargeError(
                "it took more than {minutes:g} minutes and was ended: raise --limit-minutes, or take fewer poses or "
                "eigenpairs", minutes=self._minutes,
            )  # fmt: skip
        if self._memory and resident_memory(os.getpid()) - self._held > 1e9 * self._memory:
            raise TooLargeError(
                "it took more than {memory:g} GB of memory and was ended: raise --limit-memory, or take fewer poses or "
                "eigenpairs", memory=self._memory,
            )  # fmt: skip
        self._report(stage, share)
