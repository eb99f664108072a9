"""Presets of the settings, stored by Blender beside the presets of its own tools."""

from __future__ import annotations

from typing import ClassVar

import bpy
from bl_operators.presets import AddPresetBase
from bl_ui.utils import PresetPanel

PRESET_FOLDER = "wks_segment"
"""Folder below the user's presets."""
PRESET_SETTINGS = (
    "source", "pose_count", "n_segments", "auto_segments", "sides", "n_eigenpairs", "n_energies", "covariance_type",
    "random_state", "smoothness", "min_share", "snap_to", "preset", "pieces", "scaling", "laplacian", "palette",
    "write_colors", "write_ucupaint", "write_materials", "write_face_sets", "write_seams", "vertex_groups",
    "bake_size", "bake_margin",
)  # fmt: skip
"""Settings that a preset contains: not what belongs to one file, such as frames or a model."""


class WKS_SEGMENT_MT_presets(bpy.types.Menu):
    """Menu of the stored presets."""

    bl_label = "WKS Segment Presets"
    preset_subdir = PRESET_FOLDER
    preset_operator = "script.execute_preset"
    draw = bpy.types.Menu.draw_preset


class WKS_SEGMENT_OT_add_preset(AddPresetBase, bpy.types.Operator):
    """Add the current settings to the presets, or remove a preset"""

    bl_idname = "wks_segment.add_preset"
    bl_label = "Add Settings Preset"
    preset_menu = "WKS_SEGMENT_MT_presets"
    preset_subdir = PRESET_FOLDER
    preset_defines: ClassVar[list[str]] = ["settings = bpy.context.scene.wks_segment"]
    preset_values: ClassVar[list[str]] = [f"settings.{name}" for name in PRESET_SETTINGS]


class WKS_SEGMENT_PT_presets(PresetPanel, bpy.types.Panel):
    """Button in the header of the main panel."""

    bl_label = "WKS Segment Presets"
    preset_subdir = PRESET_FOLDER
    preset_operator = "script.execute_preset"
    preset_add_operator = "wks_segment.add_preset"


CLASSES = (WKS_SEGMENT_MT_presets, WKS_SEGMENT_OT_add_preset, WKS_SEGMENT_PT_presets)
