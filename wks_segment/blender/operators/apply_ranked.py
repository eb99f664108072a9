"""Apply Ranked Model."""

from __future__ import annotations

from copy import copy
from pathlib import Path

import bpy
from bpy.props import IntProperty

from ...core.message import Message
from ..errors import UserError
from ..parts import part_ids
from ..workflow import model_library
from ..workflow.live_session import session_of
from ..workflow.model_ranking import ranked_objects
from ..workflow.segmentation_job import SegmentationJob
from . import _needs
from ._base import LabelOperator


def _stored_ranking(context: bpy.types.Context) -> Message | None:
    """A message if this scene has no ranking."""
    return None if context.scene.wks_segment.ranking else Message("No ranking yet: use Rank Models")


class WKS_SEGMENT_OT_apply_ranked(LabelOperator, bpy.types.Operator):
    """Apply Ranked Model."""

    bl_idname = "wks_segment.apply_ranked"
    bl_label = "Apply Ranked Model"
    bl_description = (
        "Apply this model of the ranking to the ranked character, with its names and colors. The other models stay"
    )
    bl_options = {"REGISTER", "UNDO"}

    needs = (_stored_ranking, _needs.no_job, _needs.object_mode)
    verb = "Applied"
    index: IntProperty(
        name="Rank", description="Place of the model in the ranking, 0 for the best", min=0, options={"SKIP_SAVE"}
    )

    def read(self, context: bpy.types.Context) -> SegmentationJob:
        """Read the character, the model and the settings."""
        settings = context.scene.wks_segment
        if self.index >= len(settings.ranking):
            raise UserError("The ranking has only {count} models", count=len(settings.ranking))
        item = settings.ranking[self.index]
        if item.path:
            model = model_library.loaded(Path(item.path))
        else:
            texts = dict(model_library.all_of(settings))
            if item.name not in texts:
                raise UserError('The model "{name}" is gone: rank the models again', name=item.name)
            model = model_library.from_text(texts[item.name])
        row = settings.models.get(item.name) if not item.path else None
        uid = "" if row is None else row.uid
        return SegmentationJob.applying(context, session_of(context).cache, model, ranked_objects(context), uid)

    def write_result(self, context: bpy.types.Context) -> set[str]:
        """Use the model, write the labels and report them."""
        self.job.guard.check_fully()  # before anything is changed
        settings = self.job.guard.scene().wks_segment
        item = settings.ranking[self.index]
        if not item.path:
            model_library.use(settings, settings.models.find(item.name))
        else:
            model, file = self.job.model, Path(item.path).name
            summary = [Message("From {names}", names=file), Message("{count} segments", count=model.n_segments_)]
            is_starter = Path(item.path) in model_library.starters().values()
            add = model_library.add_once if is_starter else model_library.add_model
            labels = add(settings, copy(model), item.name, summary)
            self.job.uid = part_ids.model_of(labels)
            # The model is in the scene now, under a name that may have got a number.
            item.name, item.path = settings.models[settings.used_model].name, ""
        return super().write_result(context)
