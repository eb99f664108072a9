"""Load Model."""

from __future__ import annotations

from pathlib import Path

import bpy
from bpy.props import StringProperty
from bpy_extras.io_utils import ImportHelper

from ...core import ModelFileError, PoseSegmentation


class WKS_SEGMENT_OT_load_model(bpy.types.Operator, ImportHelper):
    """Load a model from a file into this scene, in the place of the one that is there"""

    bl_idname = "wks_segment.load_model"
    bl_label = "Load Model"
    bl_options = {"REGISTER", "UNDO"}

    filename_ext = ".json"
    filter_glob: StringProperty(default="*.json", options={"HIDDEN"})

    def execute(self, context: bpy.types.Context) -> set[str]:
        path = Path(bpy.path.abspath(self.filepath))
        try:
            model = PoseSegmentation.load(path)
        except (ModelFileError, OSError) as error:
            self.report({"ERROR"}, f"{path.name} was not loaded: {error}")
            return {"CANCELLED"}
        settings = context.scene.wks_segment
        settings.keep_notes(model.part_notes_)
        settings.keep_model(model, [f"From {path.name}", f"{model.n_segments_} segments"])
        self.report({"INFO"}, f"Loaded a model of {model.n_segments_} segments from {path.name}")
        return {"FINISHED"}
