"""Presets of the settings, kept by Blender with those of its own tools."""

from __future__ import annotations

from typing import ClassVar

import bpy
from bl_operators.presets import AddPresetBase
from bl_ui.utils import PresetPanel

FOLDER = "wks_segment"
"""Below the user's folder of presets."""
KEPT = (
    "source", "pose_count", "n_segments", "auto_segments", "sides", "n_eigenpairs", "n_energies", "covariance_type",
    "random_state", "smoothness", "min_share", "snap_to", "preset", "pieces", "scaling", "laplacian", "palette",
    "write_colors", "write_materials", "write_face_sets", "write_seams", "vertex_groups", "bake_size", "bake_margin",
)  # fmt: skip
"""Settings that a preset is of; not what belongs to one file, as frames or a model."""


class WKS_SEGMENT_MT_presets(bpy.types.Menu):
    """The presets that are there."""

    bl_label = "WKS Segment Presets"
    preset_subdir = FOLDER
    preset_operator = "script.execute_preset"
    draw = bpy.types.Menu.draw_preset


class WKS_SEGMENT_OT_add_preset(AddPresetBase, bpy.types.Operator):
    """Add the settings of now to the presets, or remove one"""

    bl_idname = "wks_segment.add_preset"
    bl_label = "Add Settings Preset"
    preset_menu = "WKS_SEGMENT_MT_presets"
    preset_subdir = FOLDER
    preset_defines: ClassVar[list[str]] = ["settings = bpy.context.scene.wks_segment"]
    preset_values: ClassVar[list[str]] = [f"settings.{name}" for name in KEPT]


class WKS_SEGMENT_PT_presets(PresetPanel, bpy.types.Panel):
    """The button in the header of the panel."""

    bl_label = "WKS Segment Presets"
    preset_subdir = FOLDER
    preset_operator = "script.execute_preset"
    preset_add_operator = "wks_segment.add_preset"


CLASSES = (WKS_SEGMENT_MT_presets, WKS_SEGMENT_OT_add_preset, WKS_SEGMENT_PT_presets)
