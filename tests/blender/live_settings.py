"""Labels that follow the settings, without waiting for the timer."""

import bpy


def rest(session):
    """What the timer does when the settings have rested."""
    session._due = 0.0
    if bpy.app.timers.is_registered(session.timer):
        bpy.app.timers.unregister(session.timer)
    return session.on_timer()
