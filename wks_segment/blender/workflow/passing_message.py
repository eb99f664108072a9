"""A message in the panel that goes away by itself."""

from __future__ import annotations

import time

import bpy

MESSAGE_SECONDS = 30.0
"""Seconds that a message stays: long enough to read three lines after looking elsewhere. What was reported is in the
Info editor for longer."""


class PassingMessage:
    """A message that tells of a moment, such as why a job ended, and goes away when it is no longer news."""

    def __init__(self) -> None:
        self._text, self._until = "", 0.0

    @property
    def text(self) -> str:
        """What is to be shown; empty once the time is over."""
        return self._text if time.monotonic() < self._until else ""

    def show(self, text: str) -> None:
        """Show a text from now, in place of any other; an empty one shows nothing."""
        self._text, self._until = text, time.monotonic() + MESSAGE_SECONDS
        if text and not bpy.app.background:
            bpy.app.timers.register(_redraw, first_interval=MESSAGE_SECONDS + 0.1)


def redraw_sidebars(context: bpy.types.Context) -> None:
    """Redraw the sidebars of all 3D viewports, where the panel is."""
    for window in context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                for region in area.regions:
                    if region.type == "UI":
                        region.tag_redraw()


def _redraw() -> None:
    redraw_sidebars(bpy.context)
