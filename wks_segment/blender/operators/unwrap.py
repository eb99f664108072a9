"""Unwrap Segments."""

from __future__ import annotations

import bpy
from bpy.props import EnumProperty

from ...core.message import Message
from ..outputs.part_attributes import labels_on
from ..outputs.unwrapping import UNWRAP_METHODS, unwrap_parts
from ..outputs.uv_maps import check_room_for_uv_map, write_uv_map
from ..scene.characters import group, selected_meshes
from . import _needs, _report
from ._base import BaseOperator


class WKS_SEGMENT_OT_unwrap(BaseOperator, bpy.types.Operator):
    """Unwrap the selected objects segment by segment into a new UV map, with seams along the borders of segments"""

    bl_idname = "wks_segment.unwrap"
    bl_label = "Unwrap Segments"
    bl_options = {"REGISTER", "UNDO"}

    needs = (_needs.no_job, _needs.object_mode, _needs.labeled_mesh)

    method: EnumProperty(
        name="Method", description="Where islands are cut in addition to the borders of segments", items=UNWRAP_METHODS
    )

    def run(self, context: bpy.types.Context) -> set[str]:
        objects = [obj for character in group(selected_meshes(context)) for obj in character.objects]
        meshes = {obj.data: labels for obj in objects if (labels := labels_on(obj.data)) is not None}
        for mesh in meshes:
            check_room_for_uv_map(mesh)
        for mesh, labels in meshes.items():
            write_uv_map(mesh, unwrap_parts(context, mesh, labels, self.method))
        if len(meshes) == 1:
            _report.tell(self, {"INFO"}, "Unwrapped 1 mesh by segments")
        else:
            _report.tell(self, {"INFO"}, Message("Unwrapped {count} meshes by segments", count=len(meshes)))
        return {"FINISHED"}
