"""Split."""

from __future__ import annotations

import bpy
import numpy as np

from .. import parts, segments
from ..characters import group
from ..edits import by_hand, keep_by_hand
from ..errors import UserError
from ..palette import MAX_COLOURS
from ..pieces import pieces_of
from ..poses import polygon_ranges
from . import feedback


class WKS_SEGMENT_OT_split_segment(bpy.types.Operator):
    """Make each connected piece of the active segment a segment of its own. Pieces below Smallest Part stay together"""

    bl_idname = "wks_segment.split_segment"
    bl_label = "Split Segment into Connected Parts"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return feedback.has_segments(cls, context, "OBJECT")

    def execute(self, context: bpy.types.Context) -> set[str]:
        settings = context.scene.wks_segment
        part = segments.active_part(settings)
        objects = segments.labelled(settings)
        if part is None:
            return {"CANCELLED"}
        name = settings.style().name_of(part)
        try:
            found = pieces_of(group(objects), part, settings.min_share / 100)
            count = 1 + max((int(pieces.max(initial=-1)) for pieces in found.values()), default=-1)
            if count > MAX_COLOURS:
                raise UserError(f"{name} is in {count} pieces, too many for a list: raise Smallest Part (Advanced)")
        except UserError as error:
            feedback.tell(self, {"ERROR"}, str(error))
            return {"CANCELLED"}
        if count < 2:
            feedback.tell(self, {"WARNING"}, f"{name} is in one piece on these objects; nothing to split")
            return {"CANCELLED"}
        new = [segments.make_part(settings, parts.base_of(name), part // parts.SIDE) for _ in range(count - 1)]
        number = np.array([-1, *new])
        for character, pieces in found.items():
            for obj, polygons in polygon_ranges(character):
                mine = number[np.maximum(pieces[polygons], 0)]
                keep_by_hand(obj.data, np.where(mine < 0, by_hand(obj.data), mine))
        segments.rewrite_all(settings, objects)
        feedback.tell(self, {"INFO"}, f"{name} is in {count} parts now")
        return {"FINISHED"}
