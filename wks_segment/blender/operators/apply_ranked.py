"""Apply Ranked Model."""

from __future__ import annotations

from pathlib import Path

import bpy
from bpy.props import IntProperty

from ..errors import UserError
from ..workflow import model_library
from ..workflow.model_ranking import ranked_objects
from ..workflow.segmentation_job import Work
from . import _report
from ._base import RunsWork


class WKS_SEGMENT_OT_apply_ranked(RunsWork, bpy.types.Operator):
    """Use a model of the ranking, with its names and colors, and apply it to the character that was ranked"""

    bl_idname = "wks_segment.apply_ranked"
    bl_label = "Apply Ranked Model"
    bl_options = {"REGISTER", "UNDO"}

    verb = "Applied"
    index: IntProperty(
        name="Rank", description="Which model of the ranking, 0 is the best", min=0, options={"SKIP_SAVE"}
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not context.scene.wks_segment.ranking:
            _report.explain(cls, "No ranking yet: use Rank Models")
            return False
        return _report.no_job_runs(cls, context) and _report.in_object_mode(cls, context)

    def read(self, context: bpy.types.Context) -> Work:
        """Read the character, the model and settings."""
        settings = context.scene.wks_segment
        if self.index >= len(settings.ranking):
            raise UserError(f"The ranking has only {len(settings.ranking)} models")
        item = settings.ranking[self.index]
        texts = dict(model_library.all_of(settings))
        if not item.path and item.name not in texts:
            raise UserError(f'There is no model named "{item.name}" any more: rank anew')
        model = model_library.loaded(Path(item.path)) if item.path else model_library.from_text(texts[item.name])
        return Work.applying(context, model, ranked_objects(context))

    def written(self, context: bpy.types.Context) -> set[str]:
        """Use the model, write what was computed and report."""
        self.work.watch.look()  # before anything is changed
        settings = self.work.watch.scene().wks_segment
        item = settings.ranking[self.index]
        if not item.path:
            model_library.use(settings, settings.models.find(item.name))
        else:
            path = Path(item.path)
            summary = [f"From {path.name}", f"{self.work.model.n_segments_} segments"]
            model_library.add(settings, self.work.model, item.name, summary)
            # It is in the scene from now on.
            item.name, item.path = settings.models[settings.used_model].name, ""
        return super().written(context)
