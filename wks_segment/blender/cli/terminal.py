"""Progress and tables on a terminal, and a standard output that has nothing but the result."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TextIO

from ...core.progress import Progress, ReportFunction
from ..streams import flush_streams


@contextmanager
def terminal_progress() -> Iterator[Progress]:
    """Progress on standard error: a bar if it is a terminal and rich is installed, otherwise a line for each stage."""
    try:
        from rich.console import Console
        from rich.progress import BarColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn
        from rich.progress import Progress as Bar
    except ImportError:  # inside Blender: rich is not worth a wheel in the extension
        yield Progress(_line_for_each_stage())
        return
    console = Console(stderr=True)
    if not console.is_terminal:
        yield Progress(_line_for_each_stage())
        return
    columns = (TextColumn("{task.description:<44}"), BarColumn(), TimeElapsedColumn(), TimeRemainingColumn())
    with Bar(*columns, console=console) as bar:
        task = bar.add_task("", total=1.0)

        def show(stage: str, fraction: float) -> None:
            bar.update(task, description=stage or None, completed=fraction)

        yield Progress(show)
        bar.update(task, description="Done", completed=1.0)


def _line_for_each_stage() -> ReportFunction:
    """Report that prints a line when a stage is reported for the first time, with the share that is done by then."""
    printed = {""}

    def show(stage: str, fraction: float) -> None:
        if stage not in printed:
            printed.add(stage)
            print(f"{round(100 * fraction):3d} %  {stage}", file=sys.stderr, flush=True)

    return show


@contextmanager
def only_result_on_stdout() -> Iterator[TextIO]:
    """Redirect standard output to standard error, since Blender prints there; yield the real one for the result."""
    sys.stdout.flush()
    real = os.dup(1)
    os.dup2(2, 1)
    try:
        with os.fdopen(os.dup(real), "w", encoding="utf-8", errors="surrogateescape") as result:
            yield result
    finally:
        flush_streams()  # text of Blender that is still in a buffer would follow the result
        os.dup2(real, 1)
        os.close(real)


def table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Text in columns, of which the first is left-aligned and the others are right-aligned."""
    widths = [max(len(row[i]) for row in (header, *rows)) for i in range(len(header))]

    def line(cells: Sequence[str]) -> str:
        return "  ".join([cells[0].ljust(widths[0]), *(c.rjust(w) for c, w in zip(cells[1:], widths[1:], strict=True))])

    return "\n".join([line(header), "  ".join("─" * width for width in widths), *map(line, rows)])
