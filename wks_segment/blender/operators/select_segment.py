"""Select Segment."""

from __future__ import annotations

import bmesh
import bpy
from bpy.props import BoolProperty

from ..outputs.ledger import note_of
from ..workflow import segment_list
from . import _report


class WKS_SEGMENT_OT_select_segment(bpy.types.Operator):
    """Select the faces of the active segment, in Edit Mode. Shift: beside those that are selected"""

    bl_idname = "wks_segment.select_segment"
    bl_label = "Select Segment"
    bl_options = {"REGISTER", "UNDO"}

    extend: BoolProperty(name="Extend", description="Keep what is selected")

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return _report.has_segments(cls, context)

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        self.extend = event.shift
        return self.execute(context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        settings = context.scene.wks_segment
        part = segment_list.active_part(settings)
        objects = [obj for obj in segment_list.labeled(settings) if obj.visible_get()]
        if context.mode == "EDIT_MESH":
            objects = [obj for obj in objects if obj.mode == "EDIT"]
        if part is None or not objects:
            _report.tell(self, {"WARNING"}, "No object with segments is to be seen here")
            return {"CANCELLED"}
        context.scene.tool_settings.mesh_select_mode = (False, False, True)
        if context.mode == "OBJECT":
            for obj in objects:
                obj.select_set(True)
            if context.view_layer.objects.active not in objects:
                context.view_layer.objects.active = objects[0]
            bpy.ops.object.mode_set(mode="EDIT")
        if not self.extend:
            bpy.ops.mesh.select_all(action="DESELECT")
        count = sum(_select(mesh, part) for mesh in segment_list.meshes_of(objects))
        _report.tell(self, {"INFO"}, f"{count} faces of {settings.style().name_of(part)}")
        return {"FINISHED"}


def _select(mesh: bpy.types.Mesh, part: int) -> int:
    """Select the faces of a part that are to be seen, in Edit Mode; how many."""
    edit = bmesh.from_edit_mesh(mesh)
    labels = edit.faces.layers.int.get(note_of(mesh).get("faces", ""))
    faces = [] if labels is None else [face for face in edit.faces if face[labels] == part and not face.hide]
    for face in faces:
        face.select_set(True)
    bmesh.update_edit_mesh(mesh, loop_triangles=False, destructive=False)
    return len(faces)
