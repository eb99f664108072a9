"""Segments From."""

from __future__ import annotations

import bpy
import numpy as np
from bpy.props import EnumProperty

from ...core.message import Message
from ..outputs.import_labels import LABEL_SOURCES, VERTEX_GROUPS, corrected_labels, corrected_parts, corrected_weights
from ..outputs.overrides import keep_by_hand
from ..outputs.part_attributes import has_labels
from ..scene.characters import group, selected_meshes
from ..workflow import pipeline
from ..workflow.pipeline import LabelRequest
from ..workflow.report import Report
from . import _needs, _report
from ._base import BaseOperator


class WKS_SEGMENT_OT_segments_from(BaseOperator, bpy.types.Operator):
    """Take the segments of the selected objects from what you have drawn or assigned, and write all outputs again"""

    bl_idname = "wks_segment.segments_from"
    bl_label = "Segments From"
    bl_options = {"REGISTER", "UNDO"}

    needs = (_needs.no_job, _needs.object_mode, _needs.selected_mesh)

    source: EnumProperty(name="From", description="Where the segments are", items=LABEL_SOURCES)

    def run(self, context: bpy.types.Context) -> set[str]:
        settings = context.scene.wks_segment
        report = Report([])
        labels, weights = {}, {}
        for character in group(selected_meshes(context)):
            parts = corrected_parts(character, self.source)
            labels[character] = corrected_labels(character, self.source, parts)
            weights[character] = corrected_weights(character, parts)
        soft = weights if self.source == VERTEX_GROUPS and settings.vertex_groups == "soft" else None
        # The imported segments replace those that were assigned by hand before.
        for mesh in (obj.data for character in labels for obj in character.objects):
            if has_labels(mesh):
                keep_by_hand(mesh, np.full(len(mesh.polygons), -1))
        pipeline.write_outputs(settings, labels, LabelRequest.of(settings, labels), report, soft)
        if settings.write_colors:
            _report.show_colors(context)
        _report.tell_warnings(self, report.warnings)
        n_parts = sum(len(set(parts.tolist())) for parts in labels.values())
        _report.tell(self, {"INFO"}, Message("{count} segments taken over", count=n_parts))
        return {"FINISHED"}
