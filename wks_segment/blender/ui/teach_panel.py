"""Panel of the parts that a model is taught."""

from __future__ import annotations

from typing import Any

import bpy

from ..props.bone_item import WKSBoneItem
from .main_panel import SubPanel

INDENT = 1.6
"""Width by which a row of the tree is indented for each row above it, in units of the interface."""


class WKS_SEGMENT_UL_bones(bpy.types.UIList):
    """Row of the tree: triangle to open it, whether it is a part, name, share of the area."""

    def draw_item(
        self, context: bpy.types.Context, layout: Any, data: Any, item: Any, icon: int, active_data: Any, *_: Any
    ) -> None:
        row = layout.row(align=True)
        row.use_property_split = False  # the panel has it, and a box without a name would be moved to the middle
        for _level in range(item.depth):
            row.separator(factor=INDENT)
        if _has_children(data.bones, item):
            row.prop(item, "open", text="", icon="DOWNARROW_HLT" if item.open else "RIGHTARROW", emboss=False)
        else:
            row.label(text="", icon="BLANK1")
        if item.parent < 0:  # always a part
            row.label(text="", icon="CHECKBOX_HLT")
        else:
            row.prop(item, "own", text="")
        name = row.row(align=True)
        name.active = item.own
        name.label(text=f"{item.name}.L/R" if item.pair else item.name, translate=False)
        share = row.row(align=True)
        share.alignment = "RIGHT"
        share.label(text=f"{100 * item.area:.1f} %")

    def filter_items(self, context: bpy.types.Context, data: Any, propname: str) -> tuple[list[int], list[int]]:
        """Show the rows below open ones only."""
        shown: list[bool] = []
        for item in getattr(data, propname):
            shown.append(item.parent < 0 or (shown[item.parent] and getattr(data, propname)[item.parent].open))
        return [self.bitflag_filter_item if show else 0 for show in shown], []


def _has_children(bones: Any, item: WKSBoneItem) -> bool:
    """Whether rows hang on a row: the next one does then, since rows are in the order of the tree."""
    after = next((i for i, other in enumerate(bones, 1) if other == item), len(bones))
    return after < len(bones) and bones[after].depth > item.depth


class WKS_SEGMENT_PT_teach(SubPanel, bpy.types.Panel):
    """Panel of the artist's own parts: where they are, the tree of bones, and the button."""

    bl_label = "My Parts"

    def draw(self, context: bpy.types.Context) -> None:
        settings = self.settings(context, "parts_from")
        if settings.parts_from == "BONES":
            self.settings(context, "usual_parts")
            number = self.layout.column()
            number.enabled = not settings.usual_parts
            number.prop(settings, "bone_parts")
        if settings.parts_from == "FACE_SETS":
            self.settings(context, "all_face_sets")
        self.settings(context, "taught_sides", "unlabeled")
        if settings.parts_from == "BONES":
            self.layout.operator("wks_segment.list_bones", icon="OUTLINER_OB_ARMATURE")
            if settings.bones:
                self.layout.template_list(
                    WKS_SEGMENT_UL_bones.__name__, "", settings, "bones", settings, "active_bone", rows=8
                )
        row = self.layout.row()
        row.scale_y = 1.4
        row.operator("wks_segment.teach", icon="MOD_EXPLODE")


CLASSES = (WKS_SEGMENT_UL_bones, WKS_SEGMENT_PT_teach)
