"""Unwrap Segments."""

from __future__ import annotations

import bpy
from bpy.props import EnumProperty

from ..errors import UserError
from ..outputs.labels import labels_on
from ..outputs.uv_maps import METHODS, check_room, unwrap_parts, write_uv_map
from ..scene.characters import group, selected_meshes
from . import _report


class WKS_SEGMENT_OT_unwrap(bpy.types.Operator):
    """Unwrap the selected objects along the borders of segments, into a UV map of its own, segment by segment"""

    bl_idname = "wks_segment.unwrap"
    bl_label = "Unwrap Segments"
    bl_options = {"REGISTER", "UNDO"}

    method: EnumProperty(name="Method", description="Where else islands are cut", items=METHODS)

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return (
            _report.no_job_runs(cls, context)
            and _report.in_object_mode(cls, context)
            and _report.has_labeled_mesh(cls, context)
        )

    def execute(self, context: bpy.types.Context) -> set[str]:
        try:
            objects = [obj for of in group(selected_meshes(context)) for obj in of.objects]
            meshes = {obj.data: labels for obj in objects if (labels := labels_on(obj.data)) is not None}
            for mesh in meshes:
                check_room(mesh)
            for mesh, labels in meshes.items():
                write_uv_map(mesh, unwrap_parts(context, mesh, labels, self.method))
        except UserError as error:
            _report.tell(self, {"ERROR"}, str(error))
            return {"CANCELLED"}
        unwrapped = "1 mesh" if len(meshes) == 1 else f"{len(meshes)} meshes"
        _report.tell(self, {"INFO"}, f"Unwrapped {unwrapped} by segments")
        return {"FINISHED"}
