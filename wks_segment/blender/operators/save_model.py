"""Export Model."""

from __future__ import annotations

from pathlib import Path

import bpy
from bpy.props import StringProperty
from bpy_extras.io_utils import ExportHelper

from ...core.message import Message, message_of
from ..errors import UserError
from ..workflow import model_library, pipeline
from . import _needs, _report
from ._base import BaseOperator


class WKS_SEGMENT_OT_save_model(BaseOperator, bpy.types.Operator, ExportHelper):
    """Save the active model to a file, with names and colors, for other scenes and for the command line"""

    bl_idname = "wks_segment.save_model"
    bl_label = "Export Model"

    needs = (_needs.model,)

    filename_ext = ".json"
    filter_glob: StringProperty(default="*.json", options={"HIDDEN"})

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        row = model_library.active_row(context.scene.wks_segment)
        if row is not None:
            self.filepath = bpy.path.clean_name(row.name) + self.filename_ext
        return super().invoke(context, event)

    def run(self, context: bpy.types.Context) -> set[str]:
        path = Path(bpy.path.abspath(self.filepath))
        path = path if path.suffix else path.with_suffix(self.filename_ext)
        try:
            model = pipeline.stored_model(context.scene.wks_segment)
            settings = context.scene.wks_segment
            model.part_notes_ = settings.notes().for_model(settings.palette)
            model_library.save(model, path, model_library.summary_of(settings))
        except (UserError, ValueError, OSError) as error:
            raise UserError("The model was not saved: {reason}", reason=message_of(error)) from error
        _report.tell(self, {"INFO"}, Message("Exported the model to {path}", path=path))
        return {"FINISHED"}
