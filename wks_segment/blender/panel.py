"""The panel in the sidebar of the 3D viewport."""

from __future__ import annotations

import bpy

NO_MODEL = "No model yet:\nselect a character,\nthen Learn and Segment"


class WKS_SEGMENT_PT_main(bpy.types.Panel):
    """Poses, the settings of the paper and the three buttons."""

    bl_label = "WKS Segment"
    bl_idname = "WKS_SEGMENT_PT_main"
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "WKS"

    def draw(self, context: bpy.types.Context) -> None:
        layout, settings = self.layout, context.scene.wks_segment
        layout.use_property_split = True
        layout.use_property_decorate = False

        column = layout.column()
        column.prop(settings, "source")
        if settings.source != "OBJECTS":
            column.prop(settings, "pose_count")
        if settings.source == "FRAMES":
            column.prop(settings, "use_frame_range")
            if settings.use_frame_range:
                column.prop(settings, "frame_first")
                column.prop(settings, "frame_last")
        column = layout.column()
        for name in ("n_segments", "n_eigenpairs", "n_energies", "covariance_type", "random_state"):
            column.prop(settings, name)

        column = layout.column(align=True)
        column.scale_y = 1.4
        column.operator("wks_segment.learn", icon="MOD_EXPLODE")
        column.operator("wks_segment.apply", icon="BRUSHES_ALL")
        layout.operator("wks_segment.clear", icon="X")


class WKS_SEGMENT_PT_outputs(bpy.types.Panel):
    """What is written."""

    bl_label = "Outputs"
    bl_parent_id = "WKS_SEGMENT_PT_main"
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        layout, settings = self.layout, context.scene.wks_segment
        layout.use_property_split = True
        layout.use_property_decorate = False
        column = layout.column(heading="Write")
        column.prop(settings, "write_colors")
        column.prop(settings, "write_materials")


class WKS_SEGMENT_PT_model(bpy.types.Panel):
    """The learned model."""

    bl_label = "Model"
    bl_parent_id = "WKS_SEGMENT_PT_main"
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        layout, settings = self.layout, context.scene.wks_segment
        column = layout.column()
        for line in (settings.model_summary or NO_MODEL).splitlines():
            column.label(text=line)
        row = layout.row(align=True)
        row.operator("wks_segment.load_model", text="Load", icon="IMPORT")
        row.operator("wks_segment.save_model", text="Save", icon="EXPORT")


class WKS_SEGMENT_PT_advanced(bpy.types.Panel):
    """What most users leave as it is."""

    bl_label = "Advanced"
    bl_parent_id = "WKS_SEGMENT_PT_main"
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        layout, settings = self.layout, context.scene.wks_segment
        layout.use_property_split = True
        layout.use_property_decorate = False
        column = layout.column()
        column.prop(settings, "min_share")
        column.prop(settings, "scaling")


CLASSES = (WKS_SEGMENT_PT_main, WKS_SEGMENT_PT_outputs, WKS_SEGMENT_PT_model, WKS_SEGMENT_PT_advanced)
