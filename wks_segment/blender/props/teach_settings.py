"""Settings of *Learn from My Parts*: where the parts are, and which bones are parts."""

from __future__ import annotations

from typing import Any

import bpy
from bpy.props import BoolProperty, CollectionProperty, EnumProperty, IntProperty

from ..parts.palette import MAX_COLORS
from .bone_item import WKSBoneItem
from .changes import listener

TEACH_SETTINGS: dict[str, dict[str, Any]] = {
    "parts_from": {
        "name": "Parts From",
        "description": "Where the parts are that a model is taught",
        "items": [
            ("BONES", "Bones", "The bone that moves a face most; bones are joined along their tree"),
            ("SEGMENTS", "Segments", "The segments of the selected objects, with all that was corrected by hand"),
            ("FACE_SETS", "Face Sets", "As they are drawn in Sculpt Mode; a few strokes are enough"),
            ("MATERIALS", "Materials", "As they are assigned to faces"),
            ("VERTEX_GROUPS", "Vertex Groups", "The group that weighs most on a face"),
        ],
        "default": "BONES",
    },
    "unlabeled": {
        "name": "Other Faces",
        "description": "What becomes of faces that belong to no part",
        "items": [
            ("learn", "Find Segments", "Find further segments there"),
            ("ignore", "Leave Out", "Learn nothing from them; each gets the part that fits it best"),
        ],
        "default": "ignore",
    },
    "taught_sides": {
        "name": "Left and Right",
        "description": "Keep left and right as two parts where names or bones tell them apart",
        "default": True,
    },
    "all_face_sets": {
        "name": "Face Set 1 Is a Part",
        "description": "Teach face set 1 as well, which Blender gives to all faces that nobody painted",
        "default": False,
    },
    "usual_parts": {
        "name": "Usual Parts",
        "description": "The usual parts of people and animals, as far as the names of bones tell them",
        "default": True,
    },
    "bone_parts": {
        "name": "Parts",
        "description": "Number of parts that bones are joined to; both sides of a pair count as one",
        "default": 12, "min": 2, "max": MAX_COLORS, "soft_max": 24,
    },
}  # fmt: skip
"""Settings of *Learn from My Parts*; the command line has them as well."""


def _bone_number_changed(settings: TeachSettings, context: bpy.types.Context) -> None:
    """Called by Blender when another number of parts from bones is wanted."""
    listener().bone_number_changed(settings)


class TeachSettings:
    """The part of the settings that is about teaching."""

    parts_from: EnumProperty(**TEACH_SETTINGS["parts_from"])
    unlabeled: EnumProperty(**TEACH_SETTINGS["unlabeled"])
    taught_sides: BoolProperty(**TEACH_SETTINGS["taught_sides"])
    all_face_sets: BoolProperty(**TEACH_SETTINGS["all_face_sets"])
    usual_parts: BoolProperty(**TEACH_SETTINGS["usual_parts"], update=_bone_number_changed)
    bone_parts: IntProperty(**TEACH_SETTINGS["bone_parts"], update=_bone_number_changed)
    bones: CollectionProperty(type=WKSBoneItem, name="Bones", description="Bones of the active character, as a tree")
    active_bone: IntProperty(name="Active Bone", description="Row of the tree of bones", min=0, max=9999)
