"""Use, duplicate and remove models of the list."""

from __future__ import annotations

import bpy
from bpy.props import StringProperty

from ..workflow import model_library
from . import _report


class WKS_SEGMENT_OT_use_model(bpy.types.Operator):
    """Use a model of this scene, with its names and colors. Labels stay until it is applied"""

    bl_idname = "wks_segment.use_model"
    bl_label = "Use Model"
    bl_options = {"REGISTER", "UNDO"}

    name: StringProperty(name="Name", description="Name of the model in the list", options={"SKIP_SAVE"})

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return _report.has_model(cls, context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        settings = context.scene.wks_segment
        model_library.adopt(settings)
        index = settings.models.find(self.name)
        if index < 0:
            known = ", ".join(row.name for row in settings.models)
            _report.tell(self, {"ERROR"}, f'There is no model named "{self.name}" in the list; there are: {known}')
            return {"CANCELLED"}
        model_library.use(settings, index)
        return {"FINISHED"}


class WKS_SEGMENT_OT_duplicate_model(bpy.types.Operator):
    """Copy the active model, with its names and colors, and use the copy"""

    bl_idname = "wks_segment.duplicate_model"
    bl_label = "Duplicate Model"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return _report.has_model(cls, context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        model_library.duplicate(context.scene.wks_segment)
        return {"FINISHED"}


class WKS_SEGMENT_OT_remove_model(bpy.types.Operator):
    """Remove the active model from this scene. What it labeled stays"""

    bl_idname = "wks_segment.remove_model"
    bl_label = "Remove Model"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return _report.has_model(cls, context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        model_library.remove(context.scene.wks_segment)
        return {"FINISHED"}
