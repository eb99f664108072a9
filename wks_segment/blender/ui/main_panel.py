"""The panel in the sidebar of the 3D viewport."""

from __future__ import annotations

import re
from textwrap import wrap
from typing import Any

import bpy

from ..props.presets import WKS_SEGMENT_PT_presets
from ..workflow.background_job import desk_of
from ..workflow.live_session import session_of
from .messages import in_panel

WIDTH = 36
"""Letters in a line of the sidebar, about: Blender cuts off what is longer."""


class _Sidebar:
    """What all panels share: their place and the look of their settings."""

    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "WKS"

    layout: Any

    def settings(self, context: bpy.types.Context, *names: str) -> Any:
        """Show settings below each other, their names to the left; returns the settings themselves."""
        settings = context.scene.wks_segment
        self.layout.use_property_split = True
        self.layout.use_property_decorate = False
        column = self.layout.column()
        for name in names:
            column.prop(settings, name)
        return settings

    def segments(self, context: bpy.types.Context) -> None:
        """Show the number of segments, gray where it is found."""
        settings = context.scene.wks_segment
        column = self.layout.column()
        number = column.column()
        number.enabled = not settings.auto_segments
        number.prop(settings, "n_segments")
        column.prop(settings, "auto_segments")

    def live(self, context: bpy.types.Context) -> None:
        """Show whether labels follow the settings, and if not, why, and how they can."""
        settings, session = context.scene.wks_segment, session_of(context)
        self.settings(context, "live")
        if not session.holds(context.scene):
            return
        row = self.layout.row()
        row.use_property_split, row.enabled = True, settings.live
        row.prop(settings, "preview")
        column = self.layout.column(align=True)
        if session.proposed is not None:
            row = column.row(align=True)
            row.operator("wks_segment.accept", icon="CHECKMARK")
            row.operator("wks_segment.discard", icon="X")
            return
        slow = session.is_slow
        if settings.live and slow:
            for line in wrapped(f"Labels take {session.seconds:.0f} seconds here, too long to follow by themselves"):
                column.label(text=line)
        for line in wrapped(session.said):
            column.label(text=line)
        if not session.follows(context.scene) and not session.waits:
            column.operator("wks_segment.update", icon="FILE_REFRESH")

    def job(self, context: bpy.types.Context) -> None:
        """Show how far the running job is, or why the last one was ended."""
        desk = desk_of(context)
        stage, left = desk.job.lines if desk.job is not None else (desk.said, "")
        if not stage:
            return
        column = self.layout.column(align=True)
        for line in wrapped(stage):
            column.label(text=line)
        if desk.job is not None:
            row = column.row(align=True)
            row.progress(factor=desk.job.share, text=left)
            row.operator("wks_segment.cancel", text="", icon="CANCEL")


class WKS_SEGMENT_PT_main(_Sidebar, bpy.types.Panel):
    """Poses, the settings that labels follow, and the three buttons."""

    bl_label = "WKS Segment"
    bl_idname = "WKS_SEGMENT_PT_main"

    def draw_header_preset(self, context: bpy.types.Context) -> None:
        WKS_SEGMENT_PT_presets.draw_panel_header(self.layout)

    def draw(self, context: bpy.types.Context) -> None:
        settings = self.settings(context, "source")
        if settings.source != "OBJECTS":
            self.settings(context, "pose_count")
        if settings.source == "FRAMES":
            self.settings(context, "use_frame_range")
            if settings.use_frame_range:
                self.settings(context, "frame_first", "frame_last")
        self.segments(context)
        self.settings(context, "sides", "smoothness", "min_share")
        self.live(context)

        column = self.layout.column(align=True)
        column.scale_y = 1.4
        column.operator("wks_segment.learn", icon="MOD_EXPLODE")
        column.operator("wks_segment.apply", icon="BRUSHES_ALL")
        self.job(context)
        self.layout.operator("wks_segment.clear", icon="X")


class SubPanel(_Sidebar):
    """A part of the panel that starts closed."""

    bl_parent_id = WKS_SEGMENT_PT_main.bl_idname
    bl_options = {"DEFAULT_CLOSED"}


class WKS_SEGMENT_PT_outputs(SubPanel, bpy.types.Panel):
    """What is written."""

    bl_label = "Outputs"

    def draw(self, context: bpy.types.Context) -> None:
        settings = self.settings(context, "palette", "write_colors", "write_materials")
        if settings.write_materials:
            self.settings(context, "material_template")
        self.settings(context, "vertex_groups", "write_face_sets", "write_seams")

        column = self.layout.column(align=True)
        column.operator("wks_segment.unwrap", icon="UV")
        column.operator("wks_segment.separate", icon="MOD_EXPLODE")
        column.operator("wks_segment.transfer", icon="MOD_DATA_TRANSFER")
        column.operator_menu_enum("wks_segment.segments_from", "source", icon="LOOP_BACK")


class WKS_SEGMENT_PT_bake(SubPanel, bpy.types.Panel):
    """The ID map."""

    bl_label = "ID Map"

    def draw(self, context: bpy.types.Context) -> None:
        self.settings(context, "bake_size", "bake_margin", "bake_unwrap")
        self.layout.operator("wks_segment.bake", icon="RENDER_STILL")


class WKS_SEGMENT_PT_advanced(SubPanel, bpy.types.Panel):
    """What most users leave as it is."""

    bl_label = "Advanced"

    def draw(self, context: bpy.types.Context) -> None:
        self.settings(
            context,
            "snap_to",
            "preset",
            "pieces",
            "n_eigenpairs",
            "n_energies",
            "covariance_type",
            "scaling",
            "laplacian",
            "random_state",
            "limit_minutes",
            "limit_memory",
        )


def wrapped(text: str) -> list[str]:
    """A message in lines that the sidebar has room for; what is a pair of numbers stays together, as "3 of 5" does."""
    pair = r"(?<=\d) (?=\d|(of|von) \d)|((?<=\d of)|(?<=\d von)) (?=\d)"
    joined = re.sub(pair, "\N{NO-BREAK SPACE}", in_panel(text))
    return [short for line in joined.splitlines() for short in wrap(line, WIDTH)]


CLASSES = (
    WKS_SEGMENT_PT_main,
    WKS_SEGMENT_PT_outputs,
    WKS_SEGMENT_PT_bake,
    WKS_SEGMENT_PT_advanced,
)
