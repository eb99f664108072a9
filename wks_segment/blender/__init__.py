"""The extension: everything that knows Blender."""

from __future__ import annotations

from typing import Any

import bpy

from . import commands, menu, operators, panel, panel_models, panel_segments, preferences, presets, session
from .jobs import HOLDER, Desk
from .model_item import WKSModelItem, WKSRankItem
from .segment_item import WKSSegmentItem
from .settings import WKSSegmentSettings
from .translations import TRANSLATIONS

CLASSES = (
    preferences.WKSSegmentPreferences,
    WKSSegmentItem,
    WKSModelItem,
    WKSRankItem,
    WKSSegmentSettings,
    *operators.CLASSES,
    *menu.CLASSES,
    *presets.CLASSES,
    # Sub-panels stand in the order of their registration.
    panel.CLASSES[0],
    *panel_segments.CLASSES,
    *panel_models.CLASSES,
    *panel.CLASSES[1:],
)
COMMAND = "wks_segment"

_commands: list[Any] = []
"""Handles of the command line, which Blender wants back on unregistering."""


def register() -> None:
    """Called by Blender when the extension is enabled."""
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    bpy.types.Scene.wks_segment = bpy.props.PointerProperty(type=WKSSegmentSettings)
    setattr(bpy.types.WindowManager, HOLDER, Desk())
    setattr(bpy.types.WindowManager, session.HOLDER, session.Session())
    bpy.app.translations.register(__name__, TRANSLATIONS)
    bpy.types.VIEW3D_MT_object.append(menu.draw_in_object_menu)
    _commands.append(bpy.utils.register_cli_command(COMMAND, commands.run))


def unregister() -> None:
    """Called by Blender when the extension is disabled."""
    bpy.utils.unregister_cli_command(_commands.pop())
    bpy.types.VIEW3D_MT_object.remove(menu.draw_in_object_menu)
    bpy.app.translations.unregister(__name__)
    for holder in (session.HOLDER, HOLDER):
        getattr(bpy.types.WindowManager, holder).close()
        delattr(bpy.types.WindowManager, holder)
    del bpy.types.Scene.wks_segment
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
