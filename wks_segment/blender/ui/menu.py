"""The operators in the Object menu, so that the menu search (F3) finds them as well."""

from __future__ import annotations

from typing import Any

import bpy


class WKS_SEGMENT_MT_object(bpy.types.Menu):
    """Operators for the selected objects."""

    bl_idname = "WKS_SEGMENT_MT_object"
    bl_label = "WKS Segment"

    def draw(self, context: bpy.types.Context) -> None:
        # As by the buttons, jobs run in a thread, and a large one is asked about.
        self.layout.operator_context = "INVOKE_DEFAULT"
        for name in ("learn", "teach", "apply", "name_parts", "rank", "apply_ranked", "clear"):
            self.layout.operator(f"wks_segment.{name}")
        self.layout.separator()
        for name in ("bake", "unwrap", "separate", "transfer"):
            self.layout.operator(f"wks_segment.{name}")
        self.layout.operator_menu_enum("wks_segment.segments_from", "source")


def draw_in_object_menu(menu: Any, context: bpy.types.Context) -> None:
    """Append the menu to Blender's Object menu."""
    menu.layout.separator()
    menu.layout.menu(WKS_SEGMENT_MT_object.bl_idname)


CLASSES = (WKS_SEGMENT_MT_object,)
