"""The list of models in the sidebar, and which of them fit."""

from __future__ import annotations

from typing import Any

import bpy

from ..props.preferences import model_folder
from ..workflow import model_library
from .main_panel import SubPanel, wrapped
from .messages import in_panel

NO_MODEL = "No model yet:\nselect a character,\nthen Learn and Segment"
NO_FOLDER = "No models there: set Model Folder in the preferences of the add-on"
SHOWN = 6
"""Models of a ranking that are shown."""


class WKS_SEGMENT_UL_models(bpy.types.UIList):
    """A row: name and number of segments. The sidebar is too narrow for more."""

    def draw_item(
        self, context: bpy.types.Context, layout: Any, data: Any, item: Any, icon: int, active_data: Any,
        active_property: str, index: int = 0, flt_flag: int = 0,
    ) -> None:  # fmt: skip
        row = layout.row(align=True)
        row.prop(item, "name", text="", emboss=False)
        segments = row.row(align=True)
        segments.alignment = "RIGHT"
        segments.label(text=str(item.n_segments or ""))


class WKS_SEGMENT_MT_model_folder(bpy.types.Menu):
    """Models of the model folder, to be added to this file."""

    bl_idname = "WKS_SEGMENT_MT_model_folder"
    bl_label = "Add from Model Folder"

    def draw(self, context: bpy.types.Context) -> None:
        found = model_library.in_folder(model_folder(context))
        self.layout.operator_context = "EXEC_DEFAULT"  # or it would ask for the file
        for name, path in found.items():
            self.layout.operator("wks_segment.load_model", text=name, translate=False).filepath = str(path)
        if not found:
            self.layout.label(text=in_panel(NO_FOLDER))


class WKS_SEGMENT_PT_models(SubPanel, bpy.types.Panel):
    """The list, what can be done with its active model, and the ranking."""

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
        layout.prop(settings, "replace_model")
        layout.operator("wks_segment.rank", icon="SORTSIZE")
        draw_ranking(layout, settings)


def draw_ranking(layout: Any, settings: Any) -> None:
    """Show which models fit, best first; a button applies one."""
    if not settings.ranking:
        return
    column = layout.column(align=True)
    for line in wrapped(settings.verdict):
        column.label(text=line)
    for index, item in enumerate(settings.ranking[:SHOWN]):
        row = column.row(align=True)
        row.label(text=item.name, translate=False)
        share = row.row(align=True)
        share.alignment = "RIGHT"
        share.label(text=f"{100 * item.probability:.0f} %")
        row.operator("wks_segment.apply_ranked", text=in_panel("Use"), icon="BRUSHES_ALL").index = index


def details(settings: Any) -> list[str]:
    """Lines on the model in use: what it was learned from, and when."""
    if not settings.model:
        return wrapped(NO_MODEL)
    row = model_library.in_use(settings)
    first, *rest = settings.model_summary.splitlines() or [""]
    facts = [line for line in rest if not line.startswith("Certainty")]
    long = [line for line in rest if line.startswith("Certainty")]
    day = [row.date] if row is not None and row.date else []
    return [found for line in (first, " · ".join([*facts, *day]), *long) for found in wrapped(line)]


CLASSES = (WKS_SEGMENT_UL_models, WKS_SEGMENT_MT_model_folder, WKS_SEGMENT_PT_models)
