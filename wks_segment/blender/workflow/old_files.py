"""Files of version 0.1.0, in which one model of the scene was in use and all labels were its labels."""

from __future__ import annotations

import json
from typing import Any

import bpy

from ..outputs.ledger import Ledger
from ..outputs.origin import LABEL_ORIGIN, Origin, enter_origin
from ..outputs.part_attributes import has_labels
from ..outputs.part_materials import LABELS_PROPERTY, part_of
from ..parts.part_style import SetNotes
from ..props.label_set import is_known
from . import model_library


def upgrade_labels() -> None:
    """Enter into the meshes and materials of an old file that their labels are those of the model in use."""
    for scene in bpy.data.scenes:
        settings = scene.wks_segment
        _name_models(settings)
        for obj in scene.objects:
            if obj.type == "MESH" and obj.data.library is None and _is_old(obj.data):
                enter_origin(obj.data, Origin(settings.labels()))
                for material in obj.data.materials:
                    if material is not None and part_of(material) is not None and LABELS_PROPERTY not in material:
                        material[LABELS_PROPERTY] = settings.labels()


def _is_old(mesh: bpy.types.Mesh) -> bool:
    return has_labels(mesh) and not mesh.is_editmode and LABEL_ORIGIN not in Ledger(mesh)


def _name_models(settings: Any) -> None:
    """Give models of an old file their identity, and their notes the key of the labels that they are about."""
    model_library.list_active(settings)
    used = settings.used_model
    for index, row in enumerate(settings.models):
        text = settings.model if index == used else row.model
        if not row.uid and text:
            row.uid = model_library.identity(settings, text)
    for index, row in enumerate(settings.models):
        _move_notes(settings, row.labels(), settings if index == used else row)
    _move_notes(settings, "", settings)


def _move_notes(settings: Any, labels: str, holder: Any) -> None:
    name = "part_notes" if holder == settings else "notes"
    text = getattr(holder, name)
    if not text:
        return
    if not is_known(labels):
        try:
            settings.keep_notes(SetNotes.of_json(json.loads(text)), labels)
        except ValueError:
            settings.keep_notes(SetNotes(), labels)
    setattr(holder, name, "")
