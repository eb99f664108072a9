"""Export Model."""

from __future__ import annotations

from pathlib import Path

import bpy
from bpy.props import StringProperty
from bpy_extras.io_utils import ExportHelper

from ...core.message import Message, message_of
from ..errors import UserError
from ..workflow import pipeline
from . import _needs, _report
from ._base import BaseOperator


class WKS_SEGMENT_OT_save_model(BaseOperator, bpy.types.Operator, ExportHelper):
    """Save the active model to a file, with names and colors, for other scenes and for the command line"""

    bl_idname = "wks_segment.save_model"
    bl_label = "Export Model"

    needs = (_needs.model,)

    filename_ext = ".json"
    filter_glob: StringProperty(default="*.json", options={"HIDDEN"})

    def run(self, context: bpy.types.Context) -> set[str]:
        path = Path(bpy.path.abspath(self.filepath))
        path = path if path.suffix else path.with_suffix(self.filename_ext)
        try:
            model = pipeline.stored_model(context.scene.wks_segment)
            settings = context.scene.wks_segment
            model.part_notes_ = settings.notes().for_model(settings.palette)
            model.save(path)
        except (UserError, ValueError, OSError) as error:
            raise UserError("The model was not saved: {reason}", reason=message_of(error)) from error
        _report.tell(self, {"INFO"}, Message("Saved the model to {path}", path=path))
        return {"FINISHED"}
