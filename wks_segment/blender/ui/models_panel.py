"""The list of models in the sidebar, and the ranking."""

from __future__ import annotations

from typing import Any

import bpy

from ...core.message import Message
from ..props.preferences import model_folder
from ..workflow import model_library
from ..workflow.certainty import is_certainty
from ..workflow.stored_messages import restored
from .main_panel import SIDEBAR_LETTERS, SubPanel, wrapped
from .messages import in_panel

NO_MODEL = "No model yet:\nselect a character,\nthen Learn and Segment"
NO_FOLDER = "No models there: set Model Folder in the preferences of the add-on"
SHOWN_RANKS = 6
"""Models of the ranking that are shown: the panel stays short, and later models are hardly ever right."""


class WKS_SEGMENT_UL_models(bpy.types.UIList):
    """Row of the list: name and number of segments. The sidebar is too narrow for more."""

    def draw_item(
        self, context: bpy.types.Context, layout: Any, data: Any, item: Any, icon: int, active_data: Any, *_: Any
    ) -> None:
        row = layout.row(align=True)
        row.prop(item, "name", text="", emboss=False)
        segments = row.row(align=True)
        segments.alignment = "RIGHT"
        segments.label(text=str(item.n_segments or ""))


class WKS_SEGMENT_MT_model_folder(bpy.types.Menu):
    """Models of the model folder, to add to this file."""

    bl_idname = "WKS_SEGMENT_MT_model_folder"
    bl_label = "Add from Model Folder"

    def draw(self, context: bpy.types.Context) -> None:
        models = model_library.starters() | model_library.in_folder(model_folder(context))
        self.layout.operator_context = "EXEC_DEFAULT"  # without the file browser
        for name, path in models.items():
            self.layout.operator("wks_segment.load_model", text=name, translate=False).filepath = str(path)
        if not models:
            self.layout.label(text=in_panel(NO_FOLDER))


class WKS_SEGMENT_PT_models(SubPanel, bpy.types.Panel):
    """Models panel: the list, buttons for its active model, and the ranking."""

    bl_label = "Models"

    def draw(self, context: bpy.types.Context) -> None:
        settings, layout = context.scene.wks_segment, self.layout
        row = layout.row()
        row.template_list(WKS_SEGMENT_UL_models.__name__, "", settings, "models", settings, "active_model", rows=4)
        column = row.column(align=True)
        column.operator("wks_segment.duplicate_model", text="", icon="DUPLICATE")
        column.operator("wks_segment.remove_model", text="", icon="REMOVE")
        column.separator()
        column.menu("WKS_SEGMENT_MT_model_folder", text="", icon="FILE_FOLDER")
        column = layout.column()
        for line in details(settings):
            column.label(text=line)
        row = layout.row(align=True)
        row.operator("wks_segment.load_model", text=in_panel("Import"), icon="IMPORT")
        row.operator("wks_segment.save_model", text=in_panel("Export"), icon="EXPORT")
        layout.prop(settings, "keep_models")
        layout.operator("wks_segment.rank", icon="SORTSIZE")
        draw_ranking(layout, settings)


def draw_ranking(layout: Any, settings: Any) -> None:
    """Show the ranked models, best first, each with a button to apply it."""
    if not settings.ranking:
        return
    column = layout.column(align=True)
    for text in restored(settings.verdict, settings.verdict_messages):
        for line in wrapped(text):
            column.label(text=line)
    for index, item in enumerate(settings.ranking[:SHOWN_RANKS]):
        row = column.row(align=True)
        row.active = item.fits
        row.label(text=item.name, translate=False)
        share = row.row(align=True)
        share.alignment = "RIGHT"
        share.label(text=f"{100 * item.probability:.0f} %" if item.fits else in_panel("does not fit"))
        row.operator("wks_segment.apply_ranked", text=in_panel("Use"), icon="BRUSHES_ALL").index = index


def details(settings: Any) -> list[str]:
    """Lines on the model in use: what it was learned from, and when."""
    if not settings.model:
        return wrapped(NO_MODEL)
    row = model_library.active_row(settings)
    origin, *others = model_library.summary_of(settings)
    sentences = [text for text in others if is_certainty(text) or len(text) > SIDEBAR_LETTERS]
    facts = [text for text in others if text not in sentences]
    day = [row.date] if row is not None and row.date else []
    texts = [origin, Message.joined(" · ", [*facts, *day]), *sentences]
    return [line for text in texts for line in wrapped(text)]


CLASSES = (WKS_SEGMENT_UL_models, WKS_SEGMENT_MT_model_folder, WKS_SEGMENT_PT_models)
