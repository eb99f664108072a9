"""Split."""

from __future__ import annotations

import bpy
import numpy as np

from ...core.message import Message
from ..errors import UserError
from ..outputs.connected_regions import regions_of
from ..outputs.overrides import by_hand, keep_by_hand
from ..parts import part_ids
from ..parts.palette import MAX_COLORS
from ..scene.characters import group, polygon_ranges
from ..workflow import segment_list
from . import _needs, _report
from ._base import BaseOperator


class WKS_SEGMENT_OT_split_segment(BaseOperator, bpy.types.Operator):
    """Make each connected region of the active segment a segment of its own, if it is not below Smallest Part"""

    bl_idname = "wks_segment.split_segment"
    bl_label = "Split Segment into Connected Regions"
    bl_options = {"REGISTER", "UNDO"}

    needs = (_needs.object_mode, _needs.active_segment)

    def run(self, context: bpy.types.Context) -> set[str]:
        settings = context.scene.wks_segment
        part = segment_list.active_part(settings)
        labels, objects = segment_list.active_labels(settings), segment_list.labeled(settings)
        if part is None:
            return {"CANCELLED"}
        name = settings.style(labels).name_of(part)
        regions_by_character = regions_of(group(objects), part, settings.min_share / 100)
        count = 1 + max((int(regions.max(initial=-1)) for regions in regions_by_character.values()), default=-1)
        if count > MAX_COLORS:
            raise UserError(
                "{segment} has {count} connected regions, too many for a list: raise Smallest Part",
                segment=name,
                count=count,
            )
        if count < 2:
            message = Message(
                "{segment} is one connected region on these objects: there is nothing to split", segment=name
            )
            _report.tell(self, {"WARNING"}, message)
            return {"CANCELLED"}
        base, side = part_ids.without_side(name), part // part_ids.SIDE_STEP
        # The first region keeps the part's own number.
        made = [segment_list.make_part(settings, labels, base, side) for _ in range(count - 1)]
        part_of_region = np.array([-1, *made])
        for character, regions in regions_by_character.items():
            for obj, polygons in polygon_ranges(character):
                new_parts = part_of_region[np.maximum(regions[polygons], 0)]
                keep_by_hand(obj.data, np.where(new_parts < 0, by_hand(obj.data), new_parts))
        warnings = segment_list.rewrite_all(settings, labels, objects)
        _report.tell(self, {"INFO"}, Message("Split {segment} into {count} segments", segment=name, count=count))
        _report.tell_warnings(self, warnings)
        return {"FINISHED"}
