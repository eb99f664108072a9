"""Fields and list follow the active object, in a window also when the user clicks another one."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import bpy
from bpy.app.handlers import persistent

from .followed_settings import follow_active
from .old_files import upgrade_labels
from .passing_message import redraw_sidebars

ACTIVE_OBJECT = "wks_segment_active_object"
"""Name of the follower at the type of Blender's window manager."""


class ActiveObject:
    """Notices that another object is active or selected, and lets fields and list follow.

    Parameters
    ----------
    followed : callable
        Called after undo and redo, once fields and list show the active object.
    """

    def __init__(self, followed: Callable[[], None]) -> None:
        self._followed = followed
        self._seen: tuple[Any, ...] = ()
        self.timer = self.on_timer
        on = bpy.app.handlers
        self._handlers = (
            (on.depsgraph_update_post, self._on_update), (on.undo_post, self._on_undo), (on.redo_post, self._on_undo),
            (on.load_post, self._on_load),
        )  # fmt: skip
        for handlers, function in self._handlers:
            handlers.append(function)
        if not bpy.app.timers.is_registered(self.timer):
            bpy.app.timers.register(self.timer, first_interval=0.0)  # a file may be open already

    def close(self) -> None:
        """Remove the handlers, before the extension is disabled."""
        for handlers, function in self._handlers:
            if function in handlers:
                handlers.remove(function)
        if bpy.app.timers.is_registered(self.timer):
            bpy.app.timers.unregister(self.timer)

    def on_timer(self) -> None:
        """Called by Blender's timer, between what the user does: no operator runs then."""
        upgrade_labels()
        follow_active(bpy.context.scene.wks_segment)
        redraw_sidebars(bpy.context)

    @persistent
    def _on_update(self, *_: Any) -> None:
        # Without a window nobody sees the fields, and those that a script has set must stay.
        if bpy.app.background:
            return
        layer = bpy.context.view_layer
        active = layer.objects.active
        now = (bpy.context.mode, active and active.session_uid, *(obj.session_uid for obj in layer.objects.selected))
        if now != self._seen:
            self._seen = now
            if not bpy.app.timers.is_registered(self.timer):
                bpy.app.timers.register(self.timer, first_interval=0.0)

    @persistent
    def _on_undo(self, *_: Any) -> None:
        follow_active(bpy.context.scene.wks_segment)
        self._followed()

    @persistent
    def _on_load(self, *_: Any) -> None:
        upgrade_labels()
        self._seen = ()
