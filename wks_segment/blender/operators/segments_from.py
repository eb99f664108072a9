"""Segments From."""

from __future__ import annotations

from functools import partial
from hashlib import blake2b
from itertools import count

import bpy
import numpy as np
from bpy.props import EnumProperty

from ...core.mesh.triangle_mesh import IntArray
from ...core.message import Message
from ..outputs.import_labels import LABEL_SOURCES, VERTEX_GROUPS, corrected_labels, corrected_parts, corrected_weights
from ..outputs.origin import Origin, origin_of
from ..outputs.overrides import by_hand, keep_by_hand, keep_model_labels, model_labels
from ..outputs.part_attributes import has_labels, labels_on
from ..props.settings import WKSSegmentSettings
from ..scene.characters import Character, group, polygon_ranges, selected_meshes
from ..workflow import pipeline, segment_list
from ..workflow.pipeline import LabelRequest
from ..workflow.report import Report
from . import _needs, _report
from ._base import BaseOperator

NEW_NAME = "New Segment"
"""Name of a segment that was drawn, until the user gives it another."""


class WKS_SEGMENT_OT_segments_from(BaseOperator, bpy.types.Operator):
    """Segments From."""

    bl_idname = "wks_segment.segments_from"
    bl_label = "Segments From"
    bl_description = (
        "Take the segments of the selected objects from face sets, materials or vertex groups that you changed, "
        "and write all outputs again. Changed faces count as assigned by hand"
    )
    bl_options = {"REGISTER", "UNDO"}

    needs = (_needs.no_job, _needs.object_mode, _needs.selected_mesh)

    source: EnumProperty(name="From", description="Where the segments are", items=LABEL_SOURCES)

    def run(self, context: bpy.types.Context) -> set[str]:
        settings, report = context.scene.wks_segment, Report([])
        n_parts = 0
        for character in group(selected_meshes(context)):
            labeled = next((obj.data for obj in character.objects if has_labels(obj.data)), None)
            origin = Origin(_new_set(settings, character)) if labeled is None else origin_of(labeled)
            make = None if labeled is None else partial(segment_list.make_part, settings, origin.labels, NEW_NAME)
            found = corrected_parts(character, self.source, make)
            parts = corrected_labels(character, self.source, found)
            weights = {character: corrected_weights(character, found)}
            soft = weights if self.source == VERTEX_GROUPS and settings.vertex_groups == "soft" else None
            request = LabelRequest.of(settings, [character])
            drawn = _drawn(character, parts)
            pipeline.write_outputs(settings, {character: parts}, request, report, soft, origin)
            for mesh, (by_person, by_model) in drawn.items():
                keep_by_hand(mesh, by_person)
                keep_model_labels(mesh, by_model)
            segment_list.fill(settings)
            n_parts += len(set(parts.tolist()))
        if settings.write_colors:
            _report.show_colors(context)
        _report.tell_warnings(self, report.warnings)
        _report.tell(self, {"INFO"}, Message("Took over {count} segments", count=n_parts))
        return {"FINISHED"}


def _new_set(settings: WKSSegmentSettings, character: Character) -> str:
    """Key of a label set for labels that no model gave."""
    known = {row.name for row in settings.label_sets}
    keys = (f"{blake2b(f'{character.name} {i}'.encode(), digest_size=8).hexdigest()}/0" for i in count())
    return next(key for key in keys if key not in known)


def _drawn(character: Character, parts: IntArray) -> dict[bpy.types.Mesh, tuple[IntArray, IntArray]]:
    """For each mesh of a character the (p,) parts by hand, −1 for none, and those of the model.

    What is as it was before was not drawn. On a mesh without segments everything was.
    """
    found = {}
    for obj, polygons in polygon_ranges(character):
        mesh, own = obj.data, parts[polygons]
        before, by_model = labels_on(mesh), model_labels(mesh)
        if before is None or by_model is None:
            found[mesh] = own, own
        else:
            found[mesh] = np.where(own == before, by_hand(mesh), own), by_model
            keep_by_hand(mesh, np.full(len(own), -1))
    return found
