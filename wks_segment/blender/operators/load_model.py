"""Import Model."""

from __future__ import annotations

from pathlib import Path

import bpy
from bpy.props import StringProperty
from bpy_extras.io_utils import ImportHelper

from ...core import ModelFileError, PoseSegmentation
from ..workflow import model_library
from . import _report


class WKS_SEGMENT_OT_load_model(bpy.types.Operator, ImportHelper):
    """Add a model from a file to those of this scene, and use it"""

    bl_idname = "wks_segment.load_model"
    bl_label = "Import Model"
    bl_options = {"REGISTER", "UNDO"}

    filename_ext = ".json"
    filter_glob: StringProperty(default="*.json", options={"HIDDEN"})

    def execute(self, context: bpy.types.Context) -> set[str]:
        path = Path(bpy.path.abspath(self.filepath))
        try:
            model = PoseSegmentation.load(path)
        except (ModelFileError, OSError) as error:
            _report.tell(self, {"ERROR"}, f"{path.name} was not loaded: {error}")
            return {"CANCELLED"}
        summary = [f"From {path.name}", f"{model.n_segments_} segments"]
        model_library.add(context.scene.wks_segment, model, path.stem, summary)
        _report.tell(self, {"INFO"}, f"Loaded a model of {model.n_segments_} segments from {path.name}")
        return {"FINISHED"}
