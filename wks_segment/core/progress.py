"""How far a computation is, and its cancellation.

A caller passes a function that is called with the stage and the share of the work that is done. `Progress` wraps it, so
that each function deals only with its own share, 0 to 1, whatever part of the whole work it is:

    progress = Progress.of(report)
    with progress.step(0.3, "mixture") as step:  # the next 30 % of this work
        mixture = fit(samples, step)             # calls step(0.5) when half of it is done
    for pose, step in progress.each(poses):      # the rest, in equal steps
        ...
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import TypeVar

from .message import Message

T = TypeVar("T")
ReportFunction = Callable[[str, float], None]
"""Called with the name of a stage and the share of the whole work that is done, 0 to 1. An error that it raises ends
the work: this is how a job is canceled."""


class Progress:
    """Progress of a work that may be a part of a larger one.

    Parameters
    ----------
    report : callable, optional
        Called with stage and share; nothing is reported if not given.
    stage : str
        Name of the stage that is reported.
    start, end : float
        Where this work begins and ends within the whole.
    """

    def __init__(
        self, report: ReportFunction | None = None, stage: str = "", start: float = 0.0, end: float = 1.0
    ) -> None:
        self.stage = stage
        self._titles: tuple[tuple[str, dict[str, object]], ...] = ()
        self._report = report
        self._start, self._end = start, end
        self._begun = 0.0

    @classmethod
    def of(cls, report: ReportFunction | Progress | None, stage: str = "") -> Progress:
        """Progress that is reported to a function of stage and share; a `Progress` stays as it is."""
        return report if isinstance(report, Progress) else cls(report, stage)

    @classmethod
    def of_share(cls, report: Callable[[float], None] | Progress | None) -> Progress:
        """Progress that is reported to a function of the share alone; a `Progress` stays as it is."""
        if report is None or isinstance(report, Progress):
            return report or cls()
        return cls(_ShareOnly(report))

    def __call__(self, share: float, stage: str | None = None) -> None:
        """Report that a share of this work is done, 0 to 1; raises what the caller's function raises."""
        if self._report is not None:
            name = self.stage if stage is None else stage
            for template, values in self._titles:
                name = Message(template, stage=name, **values)
            self._report(name, self._start + share * (self._end - self._start))

    def report(self, stage: str, share: float) -> None:
        """The same as a function of stage and share, for work that asks for one."""
        self(share, stage)

    def titled(self, template: str, **values: object) -> Progress:
        """This work with the name of each of its stages put into a template for a message: "Signature of {stage}".

        A template without that field is the one name of all stages.
        """
        title = self.part(0.0, 1.0)
        title._titles = ((template, values), *self._titles)
        return title

    def never_falling(self) -> Progress:
        """The same progress, except that a lower share than before is reported as the highest one so far.

        For work that may have to start again.
        """
        if self._report is None:
            return self
        return Progress(_HighestShare(self._report), self.stage, self._start, self._end)

    def part(self, start: float, end: float, stage: str | None = None) -> Progress:
        """The part of this work between two shares of it, under the name of another stage if one is given."""
        length = self._end - self._start
        name = self.stage if stage is None else stage
        part = Progress(self._report, name, self._start + start * length, self._start + end * length)
        part._titles = self._titles
        return part

    @contextmanager
    def step(self, share: float, stage: str | None = None) -> Iterator[Progress]:
        """The next part of this work, of a share of it; its beginning and its end are reported."""
        part = self.part(self._begun, self._begun + share, stage)
        part(0.0)
        yield part
        self._begun += share
        part(1.0)

    def each(self, items: Sequence[T], stage: str | None = None) -> Iterator[tuple[T, Progress]]:
        """Each of several items with the progress of its equal share of what is left of this work."""
        begun, share = self._begun, (1.0 - self._begun) / max(len(items), 1)
        for i, item in enumerate(items):
            part = self.part(begun + i * share, begun + (i + 1) * share, stage)
            part(0.0)
            yield item, part
            part(1.0)
        self._begun = 1.0


class _ShareOnly:
    """Report to a function of the share alone."""

    def __init__(self, report: Callable[[float], None]) -> None:
        self._report = report

    def __call__(self, stage: str, share: float) -> None:
        self._report(share)


class _HighestShare:
    """Report of the highest share so far."""

    def __init__(self, report: ReportFunction) -> None:
        self._report, self._highest = report, 0.0

    def __call__(self, stage: str, share: float) -> None:
        self._highest = max(self._highest, share)
        self._report(stage, self._highest)
