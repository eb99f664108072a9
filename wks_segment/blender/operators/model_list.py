"""Use, duplicate and remove models of the list."""

from __future__ import annotations

import bpy
from bpy.props import StringProperty

from ..errors import UserError
from ..workflow import model_library
from . import _needs
from ._base import BaseOperator


class WKS_SEGMENT_OT_use_model(BaseOperator, bpy.types.Operator):
    """Use Model."""

    bl_idname = "wks_segment.use_model"
    bl_label = "Use Model"
    bl_description = (
        "Use a model of this scene, with its names and colors. Segments of objects stay as they are until it is applied"
    )
    bl_options = {"REGISTER", "UNDO"}

    needs = (_needs.model,)

    name: StringProperty(name="Name", description="Name of the model in the list", options={"SKIP_SAVE"})

    def run(self, context: bpy.types.Context) -> set[str]:
        settings = context.scene.wks_segment
        model_library.list_active(settings)
        index = settings.models.find(self.name)
        if index < 0:
            raise UserError(
                'There is no model named "{name}" in the list; there are: {names}',
                name=self.name,
                names=", ".join(row.name for row in settings.models),
            )
        model_library.use(settings, index)
        return {"FINISHED"}


class WKS_SEGMENT_OT_duplicate_model(BaseOperator, bpy.types.Operator):
    """Copy the active model, with its names and colors, and use the copy"""

    bl_idname = "wks_segment.duplicate_model"
    bl_label = "Duplicate Model"
    bl_options = {"REGISTER", "UNDO"}

    needs = (_needs.model,)

    def run(self, context: bpy.types.Context) -> set[str]:
        model_library.duplicate(context.scene.wks_segment)
        return {"FINISHED"}


class WKS_SEGMENT_OT_remove_model(BaseOperator, bpy.types.Operator):
    """Remove the active model from this scene. Segments that it gave stay"""

    bl_idname = "wks_segment.remove_model"
    bl_label = "Remove Model"
    bl_options = {"REGISTER", "UNDO"}

    needs = (_needs.model,)

    def run(self, context: bpy.types.Context) -> set[str]:
        model_library.remove(context.scene.wks_segment)
        return {"FINISHED"}
