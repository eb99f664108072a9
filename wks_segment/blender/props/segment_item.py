"""A row of the list of segments."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np
from bpy.props import BoolProperty, FloatProperty, FloatVectorProperty, IntProperty, StringProperty

from .changes import listener
from .label_set import style_of


def _get_name(row: Any) -> str:
    return style_of(row.labels).name_of(row.number)


def _set_name(row: Any, name: str) -> None:
    listener().rename_part(row.id_data.wks_segment, row.labels, row.number, name)


def _get_color(row: Any) -> list[float]:
    return style_of(row.labels).colors_of(np.array(row.number)).tolist()


def _set_color(row: Any, color: Any) -> None:
    red, green, blue = (float(channel) for channel in color)
    listener().recolor_part(row.id_data.wks_segment, row.labels, row.number, (red, green, blue))


class WKSSegmentItem(bpy.types.PropertyGroup):
    """A part: a segment, or its left or right side. Name and color are kept in the notes on its label set."""

    name: StringProperty(
        name="Name",
        description="Name of the segment, its materials and its vertex groups, shared by both sides; empty for the "
        "number",
        get=_get_name, set=_set_name,
    )  # fmt: skip
    color: FloatVectorProperty(
        name="Color", description="Color of the segment in all outputs",
        subtype="COLOR_GAMMA", size=3, min=0.0, max=1.0, get=_get_color, set=_set_color,
    )  # fmt: skip
    labels: StringProperty(options={"HIDDEN"}, description="Key of the label set that the part belongs to")
    number: IntProperty(name="Number", description="Number that is written to faces", min=0, max=3000)
    share: FloatProperty(
        name="Share", description="Share of the surface area", min=0.0, max=100.0, precision=1, subtype="PERCENTAGE"
    )
    hidden: BoolProperty(name="Hidden", description="Whether all faces of the segment are hidden")
