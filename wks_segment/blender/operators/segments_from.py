"""Segments from …"""

from __future__ import annotations

import bpy
import numpy as np
from bpy.props import EnumProperty

from ..errors import UserError
from ..outputs.import_labels import GROUP, SOURCES, corrected_labels, corrected_parts, corrected_weights
from ..outputs.labels import has_labels
from ..outputs.overrides import keep_by_hand
from ..scene.characters import group, selected_meshes
from ..workflow import pipeline
from ..workflow.pipeline import Wanted
from ..workflow.report import Report
from . import _report


class WKS_SEGMENT_OT_segments_from(bpy.types.Operator):
    """Take the segments of the selected objects from what you drew or assigned, and write all outputs anew"""

    bl_idname = "wks_segment.segments_from"
    bl_label = "Segments From"
    bl_options = {"REGISTER", "UNDO"}

    source: EnumProperty(name="From", description="Where the segments are", items=SOURCES)

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return (
            _report.no_job_runs(cls, context)
            and _report.in_object_mode(cls, context)
            and _report.has_selected_mesh(cls, context)
        )

    def execute(self, context: bpy.types.Context) -> set[str]:
        settings = context.scene.wks_segment
        report = Report([])
        labels, weights = {}, {}
        try:
            for character in group(selected_meshes(context)):
                found = corrected_parts(character, self.source)
                labels[character] = corrected_labels(character, self.source, found)
                weights[character] = corrected_weights(character, found)
        except UserError as error:
            _report.tell(self, {"ERROR"}, str(error))
            return {"CANCELLED"}
        soft = weights if self.source == GROUP and settings.vertex_groups == "soft" else None
        # What was drawn last is what is meant, also where faces had a segment by hand.
        for mesh in (obj.data for character in labels for obj in character.objects):
            if has_labels(mesh):
                keep_by_hand(mesh, np.full(len(mesh.polygons), -1))
        pipeline.write(settings, labels, Wanted.of(settings, labels), report, soft)
        if settings.write_colors:
            _report.show_colors(context)
        for warning in report.warnings:
            _report.tell(self, {"WARNING"}, warning)
        n_parts = sum(len(set(values.tolist())) for values in labels.values())
        _report.tell(self, {"INFO"}, f"{n_parts} segments taken over")
        return {"FINISHED"}
