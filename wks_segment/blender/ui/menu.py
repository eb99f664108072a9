"""The operators in the Object menu, and thereby in Blender's search of menus (F3)."""

from __future__ import annotations

from typing import Any

import bpy


class WKS_SEGMENT_MT_object(bpy.types.Menu):
    """What can be done with the selected objects."""

    bl_idname = "WKS_SEGMENT_MT_object"
    bl_label = "WKS Segment"

    def draw(self, context: bpy.types.Context) -> None:
        # As by the buttons: a job in a thread, a question before a large one.
        self.layout.operator_context = "INVOKE_DEFAULT"
        for name in ("learn", "apply", "rank", "apply_ranked", "clear"):
            self.layout.operator(f"wks_segment.{name}")
        self.layout.separator()
        for name in ("bake", "unwrap", "separate", "transfer"):
            self.layout.operator(f"wks_segment.{name}")
        self.layout.operator_menu_enum("wks_segment.segments_from", "source")


def draw_in_object_menu(menu: Any, context: bpy.types.Context) -> None:
    """Added to Blender's own menu."""
    menu.layout.separator()
    menu.layout.menu(WKS_SEGMENT_MT_object.bl_idname)


CLASSES = (WKS_SEGMENT_MT_object,)
