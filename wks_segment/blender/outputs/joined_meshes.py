"""Meshes that were joined: Blender joins attributes, groups and slots, and keeps the ledger of the active object only.

What came with other objects is entered into the ledger again, as found by name, so that Clear takes it back.
"""

from __future__ import annotations

import bpy
import numpy as np

from ..parts.part_style import Style
from ..props.label_set import known_sets, style_of
from ..scene.attributes import OUR_HIDDEN_ATTRIBUTE, read_face_ints
from ..scene.vertex_group_access import group_owner
from .color_attribute import PART_COLORS
from .face_sets import OWN_FACE_SETS
from .id_map import JOINED, images_of_joined
from .ledger import MARK, Ledger
from .origin import origin_of
from .overrides import BY_HAND, MODEL_LABELS, OTHER_SETS, attributes_of_sets
from .own_materials import KEYS, OWN_KEYS, OWN_MATERIALS
from .part_attributes import FACE_ATTRIBUTE, VERTEX_ATTRIBUTE, labels_on
from .part_materials import without_number
from .seams import OUR_SEAMS
from .ucupaint import COLOR_IDS
from .uv_maps import UV_MAP_NAME
from .vertex_groups import GROUP_NAME

ATTRIBUTES = {
    "written": (OUR_HIDDEN_ATTRIBUTE, "INT", "FACE"),
    "faces": (FACE_ATTRIBUTE, "INT", "FACE"),
    "vertices": (VERTEX_ATTRIBUTE, "INT", "POINT"),
    "colors": (PART_COLORS, "BYTE_COLOR", "CORNER"),
    "color_ids": (COLOR_IDS, "FLOAT_COLOR", "CORNER"),
    "own_materials": (OWN_MATERIALS, "INT", "FACE"),
    KEYS: (OWN_KEYS, "INT", "FACE"),
    "own_face_sets": (OWN_FACE_SETS, "INT", "FACE"),
    "seams": (OUR_SEAMS, "BOOLEAN", "EDGE"),
    "model_labels": (MODEL_LABELS, "INT", "FACE"),
    "by_hand": (BY_HAND, "INT", "FACE"),
    "uv_map": (UV_MAP_NAME, "FLOAT2", "CORNER"),
}
"""Entries of the ledger for attributes: their name unless it was taken, their type and domain."""


def adopt(mesh: bpy.types.Mesh) -> None:
    """Enter what other objects brought with them into the ledger of a mesh, if it was joined with any."""
    marks, ledger = read_face_ints(mesh, OUR_HIDDEN_ATTRIBUTE), Ledger(mesh)
    if marks is None or not len(np.setdiff1d(marks, [0, ledger.get(MARK, 0)])):
        return
    for key, (name, data_type, domain) in ATTRIBUTES.items():
        attribute = mesh.attributes.get(name)
        is_like_ours = attribute is not None and (attribute.data_type, attribute.domain) == (data_type, domain)
        if key not in ledger and is_like_ours:
            ledger[key] = name
    sets = dict(ledger.get(OTHER_SETS, {}))
    more = [name for name in attributes_of_sets(mesh) if name not in sets.values()]
    if more:  # of which sets is not known
        ledger[OTHER_SETS] = sets | {name: name for name in more}
    images = images_of_joined(mesh)
    if images:
        ledger[JOINED] = images
    labels = labels_on(mesh)
    if labels is not None:
        _adopt_groups(mesh, ledger, np.unique(labels).tolist())


def _adopt_groups(mesh: bpy.types.Mesh, ledger: Ledger, parts: list[int]) -> None:
    """Enter the vertex groups that have the name of a part."""
    styles = [Style(), *map(style_of, [*known_sets(), origin_of(mesh).labels])]
    part_of_name = {GROUP_NAME.format(style.name_of(part)): part for style in styles for part in parts}
    names, numbers = list(ledger.get("vertex_groups", [])), list(ledger.get("group_parts", []))
    with group_owner(mesh) as owner:
        for group in owner.vertex_groups:
            name = group.name
            part = part_of_name.get(without_number(name))
            if part is not None and name not in names and name not in ledger.get("own_groups", []):
                names.append(name)
                numbers.append(part)
    if names:
        ledger["vertex_groups"], ledger["group_parts"] = names, numbers
