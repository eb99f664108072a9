"""What holds for all files of a user: the add-on's preferences."""

from __future__ import annotations

from typing import Any

import bpy
from bpy.props import FloatProperty, IntProperty, StringProperty

PACKAGE = __package__.rsplit(".", 3)[0]
"""What Blender calls the extension: the package whose door hands over to `wks_segment.blender`. Without an extension
around it, the package itself, which no preferences are kept for."""
MOST_MEMORY = 1024**2
"""Megabytes: a terabyte."""


class WKSSegmentPreferences(bpy.types.AddonPreferences):
    """Where models are, and how much memory and time may be spent unasked."""

    bl_idname = PACKAGE

    model_folder: StringProperty(
        name="Model Folder",
        description="Models in this folder (.json) can be added to every file, and take part in Rank Models",
        subtype="DIR_PATH",
    )
    cache_megabytes: IntProperty(
        name="Memory for Signatures",
        description="Megabytes in which signatures are kept, so that a second run on the same pose takes no time",
        default=1000, min=0, max=MOST_MEMORY, soft_max=16_000,
    )  # fmt: skip
    live_seconds: FloatProperty(
        name="Live up to Seconds",
        description="Labels that took longer the last time do not follow the settings by themselves",
        default=5.0, min=0.0, max=600.0, soft_max=30.0, precision=1,
    )  # fmt: skip

    def draw(self, context: bpy.types.Context) -> None:
        self.layout.use_property_split = True
        for name in ("model_folder", "cache_megabytes", "live_seconds"):
            self.layout.prop(self, name)


def preference(context: bpy.types.Context, name: str) -> Any:
    """A preference; its default where the extension is not installed, as in plain `bpy`."""
    addon = context.preferences.addons.get(PACKAGE)
    if addon is not None and addon.preferences is not None:
        return getattr(addon.preferences, name)
    return WKSSegmentPreferences.bl_rna.properties[name].default


def model_folder(context: bpy.types.Context) -> str:
    """The model folder as a path; empty if none is set."""
    folder: str = preference(context, "model_folder")
    return bpy.path.abspath(folder) if folder else ""
