"""Import Model."""

from __future__ import annotations

from pathlib import Path

import bpy
from bpy.props import StringProperty
from bpy_extras.io_utils import ImportHelper

from ... import core
from ...core.message import Message, message_of
from ..errors import UserError
from ..workflow import model_library
from . import _report
from ._base import BaseOperator


class WKS_SEGMENT_OT_load_model(BaseOperator, bpy.types.Operator, ImportHelper):
    """Import Model."""

    bl_idname = "wks_segment.load_model"
    bl_label = "Import Model"
    bl_description = (
        "Add a model from a file to the models of this scene, and use it. Segments of objects stay as they are "
        "until it is applied"
    )
    bl_options = {"REGISTER", "UNDO"}

    filename_ext = ".json"
    filter_glob: StringProperty(default="*.json", options={"HIDDEN"})

    def run(self, context: bpy.types.Context) -> set[str]:
        path = Path(bpy.path.abspath(self.filepath))
        try:
            model, summary = core.PoseSegmentation.load(path), model_library.summary_in(path)
        except (core.ModelFileError, OSError) as error:
            raise UserError("{file} was not loaded: {reason}", file=path.name, reason=message_of(error)) from error
        count = model.n_segments_
        summary = summary or [Message("From {names}", names=path.name), Message("{count} segments", count=count)]
        model_library.add_model(context.scene.wks_segment, model, path.stem, summary)
        _report.tell(
            self, {"INFO"}, Message("Imported a model of {count} segments from {file}", count=count, file=path.name)
        )
        return {"FINISHED"}
