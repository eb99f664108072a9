"""Unwrap Segments."""

from __future__ import annotations

import bpy
from bpy.props import EnumProperty

from ...core.message import Message
from ..outputs.part_attributes import labels_on
from ..outputs.unwrapping import UNWRAP_METHODS, unwrap_parts, unwrapped_message
from ..outputs.uv_maps import check_room_for_uv_map, write_uv_map
from ..scene.characters import group, selected_meshes
from . import _needs, _report
from ._base import BaseOperator


class WKS_SEGMENT_OT_unwrap(BaseOperator, bpy.types.Operator):
    """Unwrap the selected objects into a new UV map, cut at borders of segments and along the inner side of limbs"""

    bl_idname = "wks_segment.unwrap"
    bl_label = "Unwrap Segments"
    bl_options = {"REGISTER", "UNDO"}

    needs = (_needs.no_job, _needs.object_mode, _needs.labeled_mesh)

    method: EnumProperty(
        name="Method", description="Where islands are cut in addition to the borders of segments", items=UNWRAP_METHODS
    )

    def run(self, context: bpy.types.Context) -> set[str]:
        objects = [obj for character in group(selected_meshes(context)) for obj in character.objects]
        labeled = {obj.data: (obj, labels) for obj in objects if (labels := labels_on(obj.data)) is not None}
        for mesh in labeled:
            check_room_for_uv_map(mesh)
        with _report.cursor_progress(context) as progress:
            for (mesh, (obj, labels)), step in progress.each(list(labeled.items())):
                step(0.0, Message('UV map of "{name}"', name=obj.name))
                write_uv_map(mesh, unwrap_parts(context, obj, labels, self.method))
                _report.tell(self, {"INFO"}, unwrapped_message(obj))
        return {"FINISHED"}
