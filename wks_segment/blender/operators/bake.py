"""Bake ID Map."""

from __future__ import annotations

import bpy

from ...core.message import Message
from ..outputs.bake import BakeOptions, bake_id_maps
from ..scene.characters import group, selected_meshes
from . import _needs, _report
from ._base import BaseOperator


class WKS_SEGMENT_OT_bake(BaseOperator, bpy.types.Operator):
    """Bake ID Map."""

    bl_idname = "wks_segment.bake"
    bl_label = "Bake ID Map"
    bl_description = (
        "Bake the segments of the selected objects to an image of flat colors, with Cycles on the CPU. Needs a UV "
        "map, or Unwrap if Needed. Nothing else in the scene changes"
    )
    bl_options = {"REGISTER", "UNDO"}

    needs = (_needs.no_job, _needs.object_mode, _needs.labeled_mesh)

    def run(self, context: bpy.types.Context) -> set[str]:
        settings = context.scene.wks_segment
        size = settings.bake_size
        options = BakeOptions(size, settings.bake_margin, settings.bake_unwrap)
        images: list[str] = []
        warnings: list[str] = []
        with _report.cursor_progress(context) as progress:
            for character, step in progress.each(group(selected_meshes(context))):
                baked = bake_id_maps(context, character, options, warnings, step)
                images += [f'"{id_map.image.name}"' for id_map in baked]
        _report.tell(
            self, {"INFO"},
            Message("Baked {images}: {size} × {size} pixels, kept in this file", images=", ".join(images), size=size),
        )  # fmt: skip
        _report.tell_warnings(self, warnings)
        return {"FINISHED"}
