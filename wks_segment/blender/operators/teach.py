"""Learn from My Parts, and the tree of bones."""

from __future__ import annotations

import bpy

from ..scene.bone_weights import bone_tree_of
from ..scene.characters import group, selected_meshes
from ..scene.pose_sources import active_character
from ..workflow import bone_list
from ..workflow.live_session import session_of
from ..workflow.segmentation_job import SegmentationJob
from . import _needs
from ._base import BaseOperator, LabelOperator


class WKS_SEGMENT_OT_teach(LabelOperator, bpy.types.Operator):
    """Learn from My Parts."""

    bl_idname = "wks_segment.teach"
    bl_label = "Learn from My Parts"
    bl_description = (
        "Learn the parts that the selected characters have, with their names, and find them on these meshes and on any "
        "other. Your own face sets, materials and groups stay"
    )
    bl_options = {"REGISTER", "UNDO"}

    needs = (_needs.no_job, _needs.object_mode, _needs.selected_mesh)
    learns = True
    verb = "Learned"

    def read(self, context: bpy.types.Context) -> SegmentationJob:
        """Read the parts, the poses and the settings."""
        return SegmentationJob.teaching(context, session_of(context).cache)


class WKS_SEGMENT_OT_list_bones(BaseOperator, bpy.types.Operator):
    """List Bones."""

    bl_idname = "wks_segment.list_bones"
    bl_label = "List Bones"
    bl_description = "Show the bones of the active character as a tree, to choose which of them are parts"
    bl_options = {"REGISTER", "UNDO"}

    needs = (_needs.no_job, _needs.object_mode, _needs.selected_mesh)

    def run(self, context: bpy.types.Context) -> set[str]:
        character = active_character(context, group(selected_meshes(context)))
        bone_list.fill(context.scene.wks_segment, bone_tree_of(character))
        return {"FINISHED"}
