"""Which viewports show the colors of segments. Blender's undo does not cover viewports, so they follow it by this."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import bpy
from bpy.app.handlers import persistent

from ..outputs.ledger import Ledger

VIEWPORT_COLORS = "wks_segment_viewport_colors"
"""Name of the object at the type of Blender's window manager."""
LABEL_COLOR_TYPE = "VERTEX"
"""Color of solid shading that shows the active color attribute."""
USUAL_COLOR_TYPE = "MATERIAL"
"""Color of solid shading unless somebody chooses another."""


class ViewportColors:
    """The 3D viewports that were made to show colors, and what they showed before."""

    def __init__(self) -> None:
        self._before: dict[int, str] = {}
        self._handlers = (bpy.app.handlers.undo_post, bpy.app.handlers.redo_post)
        for handlers in self._handlers:
            handlers.append(self._follow)
        bpy.app.handlers.load_pre.append(self._forget)

    def show(self, space: Any) -> None:
        """Let a 3D viewport show the colors, if its shading is solid."""
        if _is_solid(space) and space.shading.color_type != LABEL_COLOR_TYPE:
            self._before[space.as_pointer()] = space.shading.color_type
            space.shading.color_type = LABEL_COLOR_TYPE

    def hide(self, space: Any) -> None:
        """Let a 3D viewport that shows the colors show what it did before."""
        if _is_solid(space) and space.shading.color_type == LABEL_COLOR_TYPE:
            space.shading.color_type = self._before.setdefault(space.as_pointer(), USUAL_COLOR_TYPE)

    def close(self) -> None:
        """Remove the handlers, before the extension is disabled."""
        for handlers in self._handlers:
            handlers.remove(self._follow)
        bpy.app.handlers.load_pre.remove(self._forget)

    @persistent
    def _follow(self, *_: Any) -> None:
        """After undo and redo, show colors if there are any, unless the user has chosen something else."""
        has_colors = any("colors" in Ledger(obj.data) for obj in bpy.context.scene.objects if obj.type == "MESH")
        for space in _viewports():
            before = self._before.get(space.as_pointer())
            if before is None:
                continue
            here, there = (before, LABEL_COLOR_TYPE) if has_colors else (LABEL_COLOR_TYPE, before)
            if _is_solid(space) and space.shading.color_type == here:
                space.shading.color_type = there

    @persistent
    def _forget(self, *_: Any) -> None:
        """Another file has other viewports."""
        self._before.clear()


def viewport_colors_of(context: bpy.types.Context) -> ViewportColors:
    """The viewports' colors of this Blender."""
    colors: ViewportColors = getattr(context.window_manager, VIEWPORT_COLORS)
    return colors


def _is_solid(space: Any) -> bool:
    return space is not None and space.type == "VIEW_3D" and space.shading.type == "SOLID"


def _viewports() -> Iterator[Any]:
    for screen in bpy.data.screens:
        for area in screen.areas:
            yield from (space for space in area.spaces if space.type == "VIEW_3D")
