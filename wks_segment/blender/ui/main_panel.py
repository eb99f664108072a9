"""The panel in the sidebar of the 3D viewport."""

from __future__ import annotations

import re
from textwrap import wrap
from typing import Any

import bpy

from ...core.message import Message
from ..props.presets import WKS_SEGMENT_PT_presets
from ..workflow.background_job import BackgroundJob, job_holder
from ..workflow.live_session import ASLEEP, session_of
from .messages import in_panel

SIDEBAR_LETTERS = 36
"""Letters in a line of the sidebar at its default width, about: Blender cuts off the rest."""


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

    def live(self, context: bpy.types.Context) -> None:
        """Show whether labels follow the settings, and if not, why not and the button to update them."""
        settings, session = context.scene.wks_segment, session_of(context)
        self.settings(context, "live")
        if not session.can_update(context.scene):
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
        slow, asleep = session.is_slow, not session.holds(context.scene)
        if settings.live and slow:
            text = Message("Labels take {seconds:.0f} seconds here, too long to update live", seconds=session.seconds)
            for line in wrapped(text):
                column.label(text=line)
        for line in wrapped(session.message or (ASLEEP if settings.live and asleep else "")):
            column.label(text=line)
        if asleep or (not session.is_current(context.scene) and not session.is_scheduled):
            column.operator("wks_segment.update", icon="FILE_REFRESH")

    def job(self, context: bpy.types.Context) -> None:
        """Show the stage and the progress of the running job, or why the last one ended."""
        holder = job_holder(context)
        stage, left = job_texts(holder.job) if holder.job is not None else (in_panel(holder.message), "")
        if not stage:
            return
        column = self.layout.column(align=True)
        for line in wrapped_lines(stage):
            column.label(text=line)
        if holder.job is not None:
            row = column.row(align=True)
            row.progress(factor=holder.job.share, text=left)
            row.operator("wks_segment.cancel", text="", icon="CANCEL")


class WKS_SEGMENT_PT_main(_Sidebar, bpy.types.Panel):
    """Main panel: poses, the settings that labels follow, and the buttons."""

    bl_label = "WKS Segment"
    bl_idname = "WKS_SEGMENT_PT_main"

    def draw_header_preset(self, context: bpy.types.Context) -> None:
        WKS_SEGMENT_PT_presets.draw_panel_header(self.layout)

    def draw(self, context: bpy.types.Context) -> None:
        settings = self.settings(context, "source")
        self.settings(context, "one_character" if settings.source == "OBJECTS" else "pose_count")
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
    """A panel within the main panel, closed at first."""

    bl_parent_id = WKS_SEGMENT_PT_main.bl_idname
    bl_options = {"DEFAULT_CLOSED"}


class WKS_SEGMENT_PT_outputs(SubPanel, bpy.types.Panel):
    """Outputs: what is written of the segments."""

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
    """Settings of the ID map, and its button."""

    bl_label = "ID Map"

    def draw(self, context: bpy.types.Context) -> None:
        self.settings(context, "bake_size", "bake_margin", "bake_unwrap")
        self.layout.operator("wks_segment.bake", icon="RENDER_STILL")


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


def job_texts(job: BackgroundJob) -> tuple[str, str]:
    """Stage and time left of a job in the user's language: "Signature of Fox · 3 of 5" and "about 20 s left".

    The share that is done as long as the time left is unknown, and why the job ends once it was asked to.
    """
    if job.ending:
        return in_panel("Canceling"), in_panel(job.reason)
    stage = re.sub(r" \((\d+ \w+ \d+)\)$", r" · \1", in_panel(job.stage).replace('"', ""))
    return stage, in_panel(job.time_left) or f"{100 * job.share:.0f} %"


def wrapped(text: str) -> list[str]:
    """A text in the user's language, in lines that fit into the sidebar."""
    return wrapped_lines(in_panel(text))


def wrapped_lines(shown: str) -> list[str]:
    """A translated text in lines that fit into the sidebar; a pair of numbers such as "3 of 5" stays in one line."""
    pair = r"(?<=\d) (?=\d|(of|von) \d)|((?<=\d of)|(?<=\d von)) (?=\d)"
    joined = re.sub(pair, "\N{NO-BREAK SPACE}", shown)
    return [short for line in joined.splitlines() for short in wrap(line, SIDEBAR_LETTERS)]


CLASSES = (
    WKS_SEGMENT_PT_main,
    WKS_SEGMENT_PT_outputs,
    WKS_SEGMENT_PT_bake,
    WKS_SEGMENT_PT_advanced,
)
