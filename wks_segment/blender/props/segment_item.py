"""A row in the list of segments."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np
from bpy.props import BoolProperty, FloatProperty, FloatVectorProperty, IntProperty, StringProperty

from ..workflow import segment_list


def _get_name(item: Any) -> str:
    return item.id_data.wks_segment.style().name_of(item.number)


def _set_name(item: Any, name: str) -> None:
    segment_list.rename(item.id_data.wks_segment, item.number, name)


def _get_color(item: Any) -> list[float]:
    return item.id_data.wks_segment.style().colors_of(np.array(item.number)).tolist()


def _set_color(item: Any, color: Any) -> None:
    red, green, blue = (float(channel) for channel in color)
    segment_list.recolor(item.id_data.wks_segment, item.number, (red, green, blue))


class WKSSegmentItem(bpy.types.PropertyGroup):
    """A segment, or its left or right part. Name and color are read from and written to the notes on the parts."""

    name: StringProperty(
        name="Name",
        description="Name of the segment, of its materials and vertex groups. The other side is called alike. Empty: "
        "the number again",
        get=_get_name, set=_set_name,
    )  # fmt: skip
    color: FloatVectorProperty(
        name="Color", description="Color of the segment wherever it is written",
        subtype="COLOR_GAMMA", size=3, min=0.0, max=1.0, get=_get_color, set=_set_color,
    )  # fmt: skip
    number: IntProperty(name="Number", description="The number that is written to faces", min=0, max=3000)
    share: FloatProperty(
        name="Share", description="Share of the area", min=0.0, max=100.0, precision=1, subtype="PERCENTAGE"
    )
    hidden: BoolProperty(name="Hidden", description="Whether all of its faces are hidden")
