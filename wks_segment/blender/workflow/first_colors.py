"""First colors: the draft of a running job, drawn over the viewport and written nowhere, until the job ends."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import bpy
from bpy.app.handlers import persistent

from ...core.mesh.triangle_mesh import IntArray
from ..errors import UserError
from ..scene.characters import Character
from .live_session import Preview

FIRST_COLORS = "wks_segment_first_colors"
"""Name of the object at the type of Blender's window manager."""
PROVISIONAL = "First colors: provisional, nothing is written yet"


class FirstColors:
    """Shows provisional labels on characters where these are now, and hides them while the characters move.

    Parameters
    ----------
    preview : Preview
        Draws the labels.

    Attributes
    ----------
    shown : bool
        Whether they are drawn.
    """

    def __init__(self, preview: Preview) -> None:
        self.preview = preview
        self.shown = False
        self._moved = False
        self._handlers = (
            (bpy.app.handlers.depsgraph_update_post, self._on_update),
            (bpy.app.handlers.frame_change_post, self._on_frame),
            (bpy.app.handlers.load_pre, self._on_load),
        )
        for handlers, function in self._handlers:
            handlers.append(function)

    def follow(self, context: bpy.types.Context, labels: Mapping[Character, IntArray]) -> None:
        """Show labels, unless something moves right now; called many times a second while a job runs."""
        if self._moved:
            self._moved = False
            self.hide()
        elif labels and not self.shown:
            try:
                self.preview.show(context, labels, {})
            except UserError:  # what it is about ends the job as well
                return
            self.shown = True
            self._moved = False  # reading the characters counts as an update

    def hide(self) -> None:
        """Stop showing labels."""
        if self.shown:
            self.preview.hide()
        self.shown = False

    def close(self) -> None:
        """Hide everything and remove the handlers, before the extension is disabled."""
        self.hide()
        for handlers, function in self._handlers:
            if function in handlers:
                handlers.remove(function)

    @persistent
    def _on_update(self, _: bpy.types.Scene, depsgraph: Any) -> None:
        if self.shown:
            self._moved |= any(
                isinstance(update.id, bpy.types.Object) and (update.is_updated_geometry or update.is_updated_transform)
                for update in depsgraph.updates
            )

    @persistent
    def _on_frame(self, *_: Any) -> None:
        self._moved |= self.shown

    @persistent
    def _on_load(self, *_: Any) -> None:
        self.hide()


def first_colors_of(context: bpy.types.Context) -> FirstColors:
    """The first colors of this Blender."""
    colors: FirstColors = getattr(context.window_manager, FIRST_COLORS)
    return colors
