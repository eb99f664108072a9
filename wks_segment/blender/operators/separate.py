"""Separate by Segments."""

from __future__ import annotations

import bpy

from ...core.message import Message
from ..errors import UserError
from ..outputs.origin import origin_of
from ..outputs.part_attributes import labels_on
from ..outputs.separate import original_of, separate
from ..props.label_set import style_of
from ..scene.characters import group, selected_meshes
from . import _needs, _report
from ._base import BaseOperator


class WKS_SEGMENT_OT_separate(BaseOperator, bpy.types.Operator):
    """Separate by Segments."""

    bl_idname = "wks_segment.separate"
    bl_label = "Separate by Segments"
    bl_description = (
        "Make an object of each segment of the selected objects. The originals are hidden, and Clear brings them back"
    )
    bl_options = {"REGISTER", "UNDO"}

    needs = (_needs.no_job, _needs.object_mode, _needs.labeled_mesh)

    def run(self, context: bpy.types.Context) -> set[str]:
        separated = []
        for character in group(selected_meshes(context)):
            for obj in character.objects:
                if original_of(obj) is not None:
                    raise UserError('"{object}" is separated already: Clear it first', object=obj.name)
                labels = labels_on(obj.data)
                if labels is not None:
                    separated += separate(context, obj, labels, style_of(origin_of(obj.data).labels))
        _report.tell(self, {"INFO"}, Message("Separated into {count} objects", count=len(separated)))
        return {"FINISHED"}
