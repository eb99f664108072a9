"""The settings that labels follow, as a mesh keeps them and as the fields show them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import bpy

from ..outputs.origin import origin_of
from ..props.changes import unheard
from ..props.label_set import style_of
from ..props.settings import LABEL_SETTINGS, WKSSegmentSettings
from . import segment_list

WRITTEN = (
    "write_colors", "write_ucupaint", "write_materials", "material_template", "vertex_groups", "write_face_sets",
    "write_seams",
)  # fmt: skip
"""Settings of what is written."""
FOLLOWED_SETTINGS = (*LABEL_SETTINGS, "snap_to", *WRITTEN)
"""Settings that labels and outputs follow."""


def values_of(settings: WKSSegmentSettings) -> dict[str, Any]:
    """Values of the settings that labels follow, as the fields show them."""
    values = {name: getattr(settings, name) for name in FOLLOWED_SETTINGS}
    template = settings.material_template
    return values | {
        "snap_to": sorted(values["snap_to"]),
        "material_template": "" if template is None else template.name,
    }


def are_alike(values: Mapping[str, Any], others: Mapping[str, Any]) -> bool:
    """Whether two sets of values give the same labels."""
    ignored = {"n_segments"} if values.get("auto_segments") else set()
    return {name: value for name, value in values.items() if name not in ignored} == {
        name: value for name, value in others.items() if name not in ignored
    }


def show(settings: WKSSegmentSettings, values: Mapping[str, Any]) -> None:
    """Show values in the fields; those that are missing, as in files of version 0.1.0, stay as they are."""
    with unheard():
        for name, value in values.items():
            if name == "snap_to":
                settings.snap_to = set(value)
            elif name == "material_template":
                settings.material_template = bpy.data.materials.get(value)
            elif name in FOLLOWED_SETTINGS:
                setattr(settings, name, value)


def follow_active(settings: WKSSegmentSettings) -> None:
    """Let fields and list show the active object, if they show another one."""
    subject = segment_list.shown_object(settings)
    if subject is not None and not subject.data.is_editmode and settings.shown != subject.data.name:
        origin = origin_of(subject.data)
        show(settings, origin.settings)
        with unheard():
            settings.palette = style_of(origin.labels).palette
    if subject is None or not subject.data.is_editmode:
        segment_list.fill(settings)
