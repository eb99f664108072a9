"""What an operator shows while it runs and reports when it ends."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import bpy

from ...core.message import Message
from ...core.progress import Progress
from ..ui.messages import in_panel, in_report, in_tooltip
from ..ui.viewport_colors import viewport_colors_of
from ..workflow.report import Report


def tell(operator: bpy.types.Operator, kind: set[str], text: str) -> None:
    """Report a text in the status bar and the Info editor."""
    operator.report(kind, in_report(text))


def explain(cls: type[bpy.types.Operator], text: str) -> None:
    """Say in the tooltip of a gray button why it is gray."""
    cls.poll_message_set(in_tooltip(text))


@contextmanager
def cursor_progress(context: bpy.types.Context) -> Iterator[Progress]:
    """Show progress at the mouse pointer and in the status bar during the block."""
    manager, workspace = context.window_manager, context.workspace

    def show(stage: str, share: float) -> None:
        manager.progress_update(round(100 * share))
        if workspace is not None:
            workspace.status_text_set(f"WKS Segment: {in_panel(stage)}")

    manager.progress_begin(0, 100)
    try:
        yield Progress(show)
    finally:
        manager.progress_end()
        if workspace is not None:
            workspace.status_text_set(None)


def finish(operator: bpy.types.Operator, verb: str, report: Report) -> set[str]:
    """Report what was done, with the warnings last so that they stay in the status bar."""
    for note in report.notes:
        tell(operator, {"INFO"}, note)
    facts = Message.joined(", ", report.facts)
    tell(operator, {"INFO"}, Message("{done}: {facts}", done=Message(verb), facts=facts))
    tell_warnings(operator, report.warnings)
    return {"FINISHED"}


def tell_warnings(operator: bpy.types.Operator, warnings: list[str]) -> None:
    """Report warnings."""
    for warning in warnings:
        tell(operator, {"WARNING"}, warning)


def show_colors(context: bpy.types.Context) -> None:
    """Let the 3D viewport that the user works in show the colors, if its shading is solid."""
    viewport_colors_of(context).show(context.space_data)


def hide_colors(context: bpy.types.Context) -> None:
    """Let the 3D viewport that the user works in show what it did before, if it shows the colors."""
    viewport_colors_of(context).hide(context.space_data)


def has_window(context: bpy.types.Context) -> bool:
    """Whether there is a window that stays responsive while a job runs."""
    return not bpy.app.background and context.window is not None
