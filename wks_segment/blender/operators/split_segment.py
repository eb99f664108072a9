"""Split."""

from __future__ import annotations

import bpy
import numpy as np

from ..errors import UserError
from ..outputs.connected_regions import pieces_of
from ..outputs.overrides import by_hand, keep_by_hand
from ..parts import part_ids
from ..parts.palette import MAX_COLORS
from ..scene.characters import group
from ..scene.poses import polygon_ranges
from ..workflow import segment_list
from . import _report


class WKS_SEGMENT_OT_split_segment(bpy.types.Operator):
    """Make each connected piece of the active segment a segment of its own. Pieces below Smallest Part stay together"""

    bl_idname = "wks_segment.split_segment"
    bl_label = "Split Segment into Connected Parts"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return _report.has_segments(cls, context, "OBJECT")

    def execute(self, context: bpy.types.Context) -> set[str]:
        settings = context.scene.wks_segment
        part = segment_list.active_part(settings)
        objects = segment_list.labeled(settings)
        if part is None:
            return {"CANCELLED"}
        name = settings.style().name_of(part)
        try:
            found = pieces_of(group(objects), part, settings.min_share / 100)
            count = 1 + max((int(pieces.max(initial=-1)) for pieces in found.values()), default=-1)
            if count > MAX_COLORS:
                raise UserError(f"{name} is in {count} pieces, too many for a list: raise Smallest Part (Advanced)")
        except UserError as error:
            _report.tell(self, {"ERROR"}, str(error))
            return {"CANCELLED"}
        if count < 2:
            _report.tell(self, {"WARNING"}, f"{name} is in one piece on these objects; nothing to split")
            return {"CANCELLED"}
        new = [
            segment_list.make_part(settings, part_ids.without_side(name), part // part_ids.SIDE_STEP)
            for _ in range(count - 1)
        ]
        number = np.array([-1, *new])
        for character, pieces in found.items():
            for obj, polygons in polygon_ranges(character):
                mine = number[np.maximum(pieces[polygons], 0)]
                keep_by_hand(obj.data, np.where(mine < 0, by_hand(obj.data), mine))
        segment_list.rewrite_all(settings, objects)
        _report.tell(self, {"INFO"}, f"{name} is in {count} parts now")
        return {"FINISHED"}
