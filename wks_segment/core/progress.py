"""Progress of a long computation, and its cancellation.

A caller passes a function that receives a stage and the share of the work that is done. `Progress` wraps it, so that
each function reports only its own share, from 0 to 1, whichever part of the whole it computes:

    progress = Progress.of(report)
    with progress.step(0.3, "mixture") as step:  # the next 30 % of this work
        mixture = fit(samples, step)             # calls step(0.5) when half of it is done
    for pose, step in progress.each(poses):      # the rest, in equal steps
        ...

An error that the caller's function raises passes through all of these: this is how a job is canceled.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import TypeVar

from .message import Message

Item = TypeVar("Item")
ReportFunction = Callable[[str, float], None]
"""Called with the name of a stage and the share of the whole work that is done, 0 to 1."""
ShareFunction = Callable[[float], None]
"""Called with the share of the whole work that is done, 0 to 1."""


class Progress:
    """Progress of a computation that may be part of a larger one.

    Parameters
    ----------
    report : callable, optional
        Called with stage and share; nothing is reported if not given.
    stage : str
        Name of the stage that is reported.
    start, end : float
        Where this work begins and ends within the whole, as shares of the whole.
    """

    def __init__(
        self, report: ReportFunction | None = None, stage: str = "", start: float = 0.0, end: float = 1.0
    ) -> None:
        self.stage = stage
        self._report = report
        self._start, self._end = start, end
        self._begun = 0.0

    @classmethod
    def of(cls, report: ReportFunction | Progress | None, stage: str = "") -> Progress:
        """Progress that is reported to a function of stage and share; a `Progress` is returned as it is."""
        return report if isinstance(report, Progress) else cls(report, stage)

    @classmethod
    def of_share(cls, report: ShareFunction | Progress | None) -> Progress:
        """Progress that is reported to a function of the share alone; a `Progress` is returned as it is."""
        if report is None or isinstance(report, Progress):
            return report or cls()
        return cls(_ShareOnly(report))

    def __call__(self, share: float, stage: str | None = None) -> None:
        """Report that a share of this work is done, 0 to 1; raises what the caller's function raises."""
        if self._report is not None:
            self._report(self.stage if stage is None else stage, self._of_whole(share))

    def part(self, start: float, end: float, stage: str | None = None) -> Progress:
        """The part of this work between two shares of it, under the name of another stage if one is given."""
        name = self.stage if stage is None else stage
        return Progress(self._report, name, self._of_whole(start), self._of_whole(end))

    def report(self, stage: str, share: float) -> None:
        """Report like a function of stage and share, for code that takes such a function."""
        self(share, stage)

    def titled(self, template: str, **values: object) -> Progress:
        """The same progress with each stage inserted into the template of a message: "Signature of {stage}".

        A template without this field becomes the name of all stages.
        """
        if self._report is None:
            return self
        return Progress(_Titled(self._report, template, values), self.stage, self._start, self._end)

    def never_falling(self) -> Progress:
        """The same progress, except that a lower share than before is reported as the highest one so far.

        For work that may have to start again.
        """
        if self._report is None:
            return self
        return Progress(_HighestShare(self._report), self.stage, self._start, self._end)

    @contextmanager
    def step(self, share: float, stage: str | None = None) -> Iterator[Progress]:
        """The next part of this work, which takes a share of it; its beginning and its end are reported."""
        part = self.part(self._begun, self._begun + share, stage)
        part(0.0)
        yield part
        self._begun += share
        part(1.0)

    def each(self, items: Sequence[Item], stage: str | None = None) -> Iterator[tuple[Item, Progress]]:
        """Each item with the progress of its equal share of the work that is left."""
        left = self.part(self._begun, 1.0, stage)
        for i, item in enumerate(items):
            part = left.part(i / len(items), (i + 1) / len(items))
            part(0.0)
            yield item, part
            part(1.0)
        self._begun = 1.0

    def _of_whole(self, share: float) -> float:
        # Both ends are met exactly: the end of one part is the beginning of the next, and the last share is 1.
        return self._start * (1.0 - share) + self._end * share


class _ShareOnly:
    """Report to a function of the share alone."""

    def __init__(self, report: ShareFunction) -> None:
        self._report = report

    def __call__(self, stage: str, share: float) -> None:
        self._report(share)


class _Titled:
    """Report with the stage inserted into a template."""

    def __init__(self, report: ReportFunction, template: str, values: dict[str, object]) -> None:
        self._report, self._template, self._values = report, template, values

    def __call__(self, stage: str, share: float) -> None:
        self._report(Message(self._template, stage=stage, **self._values), share)


class _HighestShare:
    """Report of the highest share so far."""

    def __init__(self, report: ReportFunction) -> None:
        self._report, self._highest = report, 0.0

    def __call__(self, stage: str, share: float) -> None:
        self._highest = max(self._highest, share)
        self._report(stage, self._highest)
