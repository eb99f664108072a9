"""The panel in the sidebar of the 3D viewport."""

from __future__ import annotations

import re
from textwrap import wrap
from typing import Any

import bpy

from ..props.presets import WKS_SEGMENT_PT_presets
from ..workflow.background_job import job_holder
from ..workflow.first_colors import PROVISIONAL, first_colors_of
from ..workflow.live_session import session_of
from .messages import in_panel
from .status import job_texts, status

SIDEBAR_LETTERS = 36
"""Letters in a line of the sidebar at its default width, about: Blender cuts off the rest."""
STATUS_LINES, LINE_HEIGHT = 4, 0.8
"""Lines that are kept free for messages, and the height of all but the first of them. With fewer the panels below would
move when a message comes; with more the panel would have a hole."""


class _Sidebar:
    """Shared by all panels: their place and the look of their settings."""

    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "WKS"

    layout: Any

    def settings(self, context: bpy.types.Context, *names: str) -> Any:
        """Show settings below each other with their names to the left; return the property group."""
        settings = context.scene.wks_segment
        self.layout.use_property_split = True
        self.layout.use_property_decorate = False
        column = self.layout.column()
        for name in names:
            column.prop(settings, name)
        return settings

    def segments(self, context: bpy.types.Context) -> None:
        """Show the number of segments, gray if it is automatic."""
        settings = context.scene.wks_segment
        column = self.layout.column()
        number = column.column()
        number.enabled = not settings.auto_segments
        number.prop(settings, "n_segments")
        column.prop(settings, "auto_segments")

    def frame_range(self, context: bpy.types.Context) -> None:
        """Show the range of frames in one row, gray if poses are no frames."""
        settings = context.scene.wks_segment
        row = self.layout.row(align=True, heading="Frame Range")
        row.enabled = settings.source == "FRAMES"
        row.prop(settings, "use_frame_range", text="")
        numbers = row.row(align=True)
        numbers.active = settings.use_frame_range
        numbers.prop(settings, "frame_first", text="")
        numbers.prop(settings, "frame_last", text="")

    def live(self, context: bpy.types.Context) -> None:
        """Show whether labels follow the settings, and the button to update them, or to accept a preview."""
        settings, session = context.scene.wks_segment, session_of(context)
        self.settings(context, "live")
        row = self.layout.row()
        row.use_property_split, row.enabled = True, settings.live
        row.prop(settings, "preview")
        row = self.layout.row(align=True)
        if session.proposed is not None:
            row.operator("wks_segment.accept", icon="CHECKMARK")
            row.operator("wks_segment.discard", icon="X")
            return
        asleep = not session.holds(context.scene)
        row.active = asleep or (not session.is_current(context.scene) and not session.is_scheduled)
        row.operator("wks_segment.update", icon="FILE_REFRESH")

    def status(self, context: bpy.types.Context) -> None:
        """Show the running job, or else what is to be said; the height is the same, so that nothing moves."""
        job = job_holder(context).job
        column = self.layout.column(align=True)
        first, below = column.row(align=True), column.column(align=True)
        below.scale_y = LINE_HEIGHT
        if job is None:
            line, *lines = wrapped(status(context))
            first.label(text=line)
        else:
            stage, left = job_texts(job)
            lines = wrapped_lines(stage)
            if first_colors_of(context).shown:
                told = wrapped(PROVISIONAL)
                lines = [*lines[: STATUS_LINES - 1 - len(told)], *told]
            first.progress(factor=job.share, text=left)
            first.operator("wks_segment.cancel", text="", icon="CANCEL")
        for line in [*lines, *[""] * (STATUS_LINES - 1 - len(lines))]:
            below.label(text=line)


class WKS_SEGMENT_PT_main(_Sidebar, bpy.types.Panel):
    """Main panel: poses, the settings that labels follow, and the buttons."""

    bl_label = "WKS Segment"
    bl_idname = "WKS_SEGMENT_PT_main"

    def draw_header_preset(self, context: bpy.types.Context) -> None:
        WKS_SEGMENT_PT_presets.draw_panel_header(self.layout)

    def draw(self, context: bpy.types.Context) -> None:
        settings = self.settings(context, "source")
        self.settings(context, "one_character" if settings.source == "OBJECTS" else "pose_count")
        self.frame_range(context)
        self.segments(context)
        self.settings(context, "sides", "smoothness", "min_share")
        self.live(context)

        column = self.layout.column(align=True)
        column.scale_y = 1.4
        column.operator("wks_segment.learn", icon="MOD_EXPLODE")
        column.operator("wks_segment.apply", icon="BRUSHES_ALL")
        column.operator("wks_segment.name_parts", icon="OUTLINER_DATA_FONT")
        self.layout.operator("wks_segment.clear", icon="X")
        self.status(context)


class SubPanel(_Sidebar):
    """A panel within the main panel, closed at first."""

    bl_parent_id = WKS_SEGMENT_PT_main.bl_idname
    bl_options = {"DEFAULT_CLOSED"}


class WKS_SEGMENT_PT_outputs(SubPanel, bpy.types.Panel):
    """Outputs: what is written of the segments."""

    bl_label = "Outputs"

    def draw(self, context: bpy.types.Context) -> None:
        settings = self.settings(context, "palette", "write_colors", "write_ucupaint", "write_materials")
        template = self.layout.column()
        template.active = settings.write_materials
        template.prop(settings, "material_template")
        self.settings(context, "vertex_groups", "write_face_sets", "write_seams")

        column = self.layout.column(align=True)
        column.operator("wks_segment.unwrap", icon="UV")
        column.operator("wks_segment.separate", icon="MOD_EDGESPLIT")
        column.operator("wks_segment.transfer", icon="MOD_DATA_TRANSFER")
        column.operator_menu_enum("wks_segment.segments_from", "source", icon="LOOP_BACK")


class WKS_SEGMENT_PT_bake(SubPanel, bpy.types.Panel):
    """Settings of the ID map, and its button."""

    bl_label = "ID Map"

    def draw(self, context: bpy.types.Context) -> None:
        self.settings(context, "bake_size", "bake_margin", "bake_unwrap")
        column = self.layout.column(align=True)
        column.operator("wks_segment.bake", icon="RENDER_STILL")
        column.operator("wks_segment.show_id_map", icon="IMAGE_DATA")


class WKS_SEGMENT_PT_advanced(SubPanel, bpy.types.Panel):
    """Settings that most users leave as they are."""

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
    """A text in the user's language, in lines that fit into the sidebar."""
    return wrapped_lines(in_panel(text))


def wrapped_lines(shown: str) -> list[str]:
    """A translated text in lines that fit into the sidebar; a pair of numbers such as "3 of 5" stays in one line."""
    pair = r"(?<=·) (?=\d+ (of|von) \d)|(?<=\d) (?=\d|(of|von) \d)|((?<=\d of)|(?<=\d von)) (?=\d)"
    joined = re.sub(pair, "\N{NO-BREAK SPACE}", shown)
    return [short for line in joined.splitlines() for short in wrap(line, SIDEBAR_LETTERS)]


CLASSES = (
    WKS_SEGMENT_PT_main,
    WKS_SEGMENT_PT_outputs,
    WKS_SEGMENT_PT_bake,
    WKS_SEGMENT_PT_advanced,
)
