"""Open ID Map."""

from __future__ import annotations

from contextlib import AbstractContextManager, nullcontext
from typing import Any

import bpy

from ...core.message import Message
from ..outputs.id_map import id_map_of
from ..scene.characters import selected_meshes
from ._base import BaseOperator

EDITOR = "IMAGE_EDITOR"


def _baked_image(context: bpy.types.Context) -> Message | None:
    """A message if no selected object has an ID map."""
    return None if _image_of(context) is not None else Message("No ID map yet: use Bake ID Map")


class WKS_SEGMENT_OT_show_id_map(BaseOperator, bpy.types.Operator):
    """Show the ID map of the active object in an Image Editor, which opens in a new window if there is none"""

    bl_idname = "wks_segment.show_id_map"
    bl_label = "Open ID Map"

    needs = (_baked_image,)

    def protection(self, context: bpy.types.Context) -> AbstractContextManager[None]:
        """None: only the window changes."""
        return nullcontext()

    def run(self, context: bpy.types.Context) -> set[str]:
        window, area = _open_editor(context) or _new_editor(context)
        area.spaces.active.image = _image_of(context)
        region = next(region for region in area.regions if region.type == "WINDOW")
        with context.temp_override(window=window, area=area, region=region):
            bpy.ops.image.view_all(fit_view=True)
        return {"FINISHED"}


def _image_of(context: bpy.types.Context) -> bpy.types.Image | None:
    """The ID map of the active object, or of the first selected one that has one."""
    objects = sorted(selected_meshes(context), key=lambda obj: obj != context.active_object)
    return next((image for obj in objects if (image := id_map_of(obj.data)) is not None), None)


def _open_editor(context: bpy.types.Context) -> tuple[Any, Any] | None:
    """The window and area of an Image Editor or UV Editor that is open; those of this window first."""
    windows = sorted(context.window_manager.windows, key=lambda window: window != context.window)
    return next(((window, area) for window in windows for area in window.screen.areas if area.type == EDITOR), None)


def _new_editor(context: bpy.types.Context) -> tuple[Any, Any]:
    """A new window that is an Image Editor, and its area."""
    bpy.ops.wm.window_new()
    window = context.window_manager.windows[-1]
    area = window.screen.areas[0]
    area.type = EDITOR
    return window, area
