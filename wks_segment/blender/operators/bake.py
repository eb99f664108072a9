"""Bake ID Map."""

from __future__ import annotations

import bpy

from ..errors import UserError
from ..outputs.bake import bake_id_maps
from ..scene.characters import group, selected_meshes
from . import _report


class WKS_SEGMENT_OT_bake(bpy.types.Operator):
    """Bake the segments of the selected objects to an image of flat colors in their UV maps, with Cycles on the CPU"""

    bl_idname = "wks_segment.bake"
    bl_label = "Bake ID Map"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return (
            _report.no_job_runs(cls, context)
            and _report.in_object_mode(cls, context)
            and _report.has_labeled_mesh(cls, context)
        )

    def execute(self, context: bpy.types.Context) -> set[str]:
        settings = context.scene.wks_segment
        size, margin, unwrap = settings.bake_size, settings.bake_margin, settings.bake_unwrap
        images: list[str] = []
        warnings: list[str] = []
        try:
            with _report.cursor_progress(context) as progress:
                for character in group(selected_meshes(context)):
                    baked = bake_id_maps(context, character, settings.style(), size, margin, unwrap, warnings, progress)
                    images += [f'"{id_map.image.name}"' for id_map in baked]
        except UserError as error:
            _report.tell(self, {"ERROR"}, str(error))
            return {"CANCELLED"}
        _report.tell(self, {"INFO"}, f"Baked {', '.join(images)}: {size} × {size} pixels, kept in this file")
        for warning in warnings:
            _report.tell(self, {"WARNING"}, warning)
        return {"FINISHED"}
