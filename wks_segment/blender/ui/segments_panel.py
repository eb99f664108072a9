"""The list of segments in the sidebar."""

from __future__ import annotations

from typing import Any

import bpy

from ...core.message import Message
from ..workflow.live_session import session_of
from .color_icons import color_icons_of
from .main_panel import SubPanel
from .messages import in_panel
from .translations import NAME

NAME_PRESETS = {
    "Human": (
        "Head", "Hair", "Neck", "Torso", "Hips", "Arm", "Upper Arm", "Forearm", "Hand", "Leg", "Thigh", "Shin", "Foot",
        "Clothes",
    ),
    "Quadruped": (
        "Head", "Muzzle", "Ear", "Neck", "Torso", "Tail", "Tail Tip", "Leg", "Foreleg", "Hind Leg", "Paw", "Forepaw",
        "Hind Paw", "Mane",
    ),
}  # fmt: skip
"""Names to choose from, without the suffix of a side, which comes with the part."""


ROWS = 8
"""Rows of the list: as many segments as are learned by default, half of the named parts of a person."""


class WKS_SEGMENT_UL_segments(bpy.types.UIList):
    """Row of the list: color, name, share of the area, visibility."""

    def draw_item(
        self, context: bpy.types.Context, layout: Any, data: Any, item: Any, icon: int, active_data: Any, *_: Any
    ) -> None:
        row = layout.row(align=True)
        color = row.row(align=True)
        color.ui_units_x = 1.2
        # Colors are attributes of face corners, which cannot be written in Edit Mode.
        color.enabled = context.mode != "EDIT_MESH"
        color.prop(item, "color", text="")
        row.separator(factor=0.5)
        row.prop(item, "name", text="", emboss=False)
        share = row.row(align=True)
        share.alignment = "RIGHT"
        share.label(text=f"{item.share:.1f} %")
        hidden = item.hidden and context.mode != "OBJECT"  # where Blender shows hidden faces as well
        row.operator(
            "wks_segment.hide_segment", text="", icon="HIDE_ON" if hidden else "HIDE_OFF", emboss=False
        ).part = item.number


class WKS_SEGMENT_MT_merge(bpy.types.Menu):
    """Segments that the active one can be merged into."""

    bl_idname = "WKS_SEGMENT_MT_merge"
    bl_label = "Merge Into"

    def draw(self, context: bpy.types.Context) -> None:
        settings = context.scene.wks_segment
        for index, item in enumerate(settings.segments):
            if index != settings.active_segment:
                self.layout.operator(
                    "wks_segment.merge_segments", text=item.name, translate=False,
                    icon_value=color_icons_of(context).icon(item.color),
                ).into = item.number  # fmt: skip


class WKS_SEGMENT_MT_names(bpy.types.Menu):
    """Names for the active segment."""

    bl_idname = "WKS_SEGMENT_MT_names"
    bl_label = "Name from Preset"

    def draw(self, context: bpy.types.Context) -> None:
        row = self.layout.row()
        for preset, names in NAME_PRESETS.items():
            column = row.column()
            column.label(text=preset, text_ctxt=NAME)
            for name in names:
                # As for Blender's own objects, a preference decides whether names of new data are translated.
                given = bpy.app.translations.pgettext_data(name, NAME)
                column.operator("wks_segment.name_segment", text=name, text_ctxt=NAME).name = given


class WKS_SEGMENT_MT_specials(bpy.types.Menu):
    """Operators that are needed less often."""

    bl_idname = "WKS_SEGMENT_MT_specials"
    bl_label = "Segment Specials"

    def draw(self, context: bpy.types.Context) -> None:
        self.layout.operator("wks_segment.show_segments", icon="HIDE_OFF")
        self.layout.separator()
        self.layout.operator("wks_segment.forget_faces", icon="X")
        self.layout.operator("wks_segment.restore_segments", icon="LOOP_BACK")
        self.layout.operator("wks_segment.refresh_segments", icon="FILE_REFRESH")


class WKS_SEGMENT_PT_segments(SubPanel, bpy.types.Panel):
    """Segments panel: the list, and buttons for its active segment."""

    bl_label = "Segments"
    bl_options = set()

    def draw(self, context: bpy.types.Context) -> None:
        settings, layout = context.scene.wks_segment, self.layout
        previewed = session_of(context).proposed is not None
        row = layout.row()
        row.active = not previewed
        row.template_list(
            WKS_SEGMENT_UL_segments.__name__, "", settings, "segments", settings, "active_segment", rows=ROWS
        )
        column = row.column(align=True)
        column.operator("wks_segment.select_segment", text="", icon="RESTRICT_SELECT_OFF")
        column.operator("wks_segment.isolate_segment", text="", icon="ZOOM_SELECTED")
        names = column.column(align=True)
        names.enabled = len(settings.segments) > 0
        names.menu("WKS_SEGMENT_MT_names", text="", icon="SORTALPHA")
        column.separator()
        column.menu("WKS_SEGMENT_MT_specials", text="", icon="DOWNARROW_HLT")
        row = layout.row(align=True)
        if context.mode == "EDIT_MESH":
            row.operator("wks_segment.assign_faces", text=in_panel("Assign"))
            row.operator("wks_segment.new_segment", text=in_panel("New"))
            row.operator("wks_segment.forget_faces", text=in_panel("Forget"))
        else:
            others = row.row(align=True)
            others.enabled = len(settings.segments) > 1
            others.menu("WKS_SEGMENT_MT_merge", text=in_panel("Merge Into"))
            row.operator("wks_segment.split_segment", text=in_panel("Split"))
        if previewed:
            layout.label(text=in_panel("These are the written segments"), icon="INFO")
        elif settings.faces_by_hand:
            text = Message("{count:,} faces by hand", count=settings.faces_by_hand)
            layout.label(text=in_panel(text), icon="VIEW_PAN")
        else:
            layout.label(text="")


CLASSES = (
    WKS_SEGMENT_UL_segments,
    WKS_SEGMENT_MT_merge,
    WKS_SEGMENT_MT_names,
    WKS_SEGMENT_MT_specials,
    WKS_SEGMENT_PT_segments,
)
