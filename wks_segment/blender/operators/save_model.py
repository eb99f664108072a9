"""Export Model."""

from __future__ import annotations

from pathlib import Path

import bpy
from bpy.props import StringProperty
from bpy_extras.io_utils import ExportHelper

from ..errors import UserError
from ..workflow import pipeline
from . import _report


class WKS_SEGMENT_OT_save_model(bpy.types.Operator, ExportHelper):
    """Save the active model to a file, with names and colors, for other scenes and for the command line"""

    bl_idname = "wks_segment.save_model"
    bl_label = "Export Model"

    filename_ext = ".json"
    filter_glob: StringProperty(default="*.json", options={"HIDDEN"})

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not context.scene.wks_segment.model:
            _report.explain(cls, "No model yet: use Learn and Segment, or import a model")
            return False
        return True

    def execute(self, context: bpy.types.Context) -> set[str]:
        path = Path(bpy.path.abspath(self.filepath))
        path = path if path.suffix else path.with_suffix(self.filename_ext)
        try:
            model = pipeline.stored_model(context.scene.wks_segment)
            model.part_notes_ = context.scene.wks_segment.notes()
            model.save(path)
        except (UserError, ValueError, OSError) as error:
            _report.tell(self, {"ERROR"}, f"The model was not saved: {error}")
            return {"CANCELLED"}
        _report.tell(self, {"INFO"}, f"Saved the model to {path}")
        return {"FINISHED"}
