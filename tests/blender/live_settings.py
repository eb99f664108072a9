"""Labels that follow the settings, and fields that follow the active object, without waiting for timers."""

import bpy
from builders import select


def rest(session):
    """What the timer does when the settings have rested."""
    session._due = 0.0
    if bpy.app.timers.is_registered(session.timer):
        bpy.app.timers.unregister(session.timer)
    return session.on_timer()


def click(*objects):
    """Select objects, the first of which is active, as with the mouse: fields and list follow."""
    select(*objects)
    bpy.types.WindowManager.wks_segment_active_object.on_timer()
