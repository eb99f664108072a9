"""The add-on's preferences: what holds for all files of a user."""

from __future__ import annotations

from typing import Any

import bpy
from bpy.props import FloatProperty, IntProperty, StringProperty

EXTENSION = __package__.rsplit(".", 3)[0]
"""Name of the extension in Blender: the package that contains `wks_segment`. Where no extension contains it, as in
plain `bpy`, `wks_segment` itself, for which Blender keeps no preferences."""
MAX_CACHE_MEGABYTES = 1024**2
"""A terabyte: no machine that runs Blender has more memory."""


class WKSSegmentPreferences(bpy.types.AddonPreferences):
    """The folder of models, and how much memory and time may be spent unasked."""

    bl_idname = EXTENSION

    model_folder: StringProperty(
        name="Model Folder",
        description="Folder of models (.json) that can be added to every file and take part in Rank Models",
        subtype="DIR_PATH",
    )
    cache_megabytes: IntProperty(
        name="Memory for Signatures",
        description="Megabytes of signatures to keep, so that a second run on the same pose takes no time",
        default=1000, min=0, max=MAX_CACHE_MEGABYTES, soft_max=16_000,
    )  # fmt: skip
    live_seconds: FloatProperty(
        name="Live up to Seconds",
        description="Segments that took longer than this the last time do not follow the settings by themselves",
        default=5.0, min=0.0, max=600.0, soft_max=30.0, precision=1,
    )  # fmt: skip

    def draw(self, context: bpy.types.Context) -> None:
        self.layout.use_property_split = True
        for name in ("model_folder", "cache_megabytes", "live_seconds"):
            self.layout.prop(self, name)


def preference(context: bpy.types.Context, name: str) -> Any:
    """Value of a preference; its default where the extension is not installed, as in plain `bpy`."""
    addon = context.preferences.addons.get(EXTENSION)
    if addon is not None and addon.preferences is not None:
        return getattr(addon.preferences, name)
    return WKSSegmentPreferences.bl_rna.properties[name].default


def model_folder(context: bpy.types.Context) -> str:
    """Path of the model folder; empty if none is set."""
    folder: str = preference(context, "model_folder")
    return bpy.path.abspath(folder) if folder else ""
