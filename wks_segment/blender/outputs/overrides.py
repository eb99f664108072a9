"""What a person changed of a model's parts: faces assigned by hand, parts merged. New labels leave it as it is.

One face attribute keeps the part that each face was given by hand. Where that, or merged parts, make labels other than
the model's, another attribute keeps the model's, to go back to. What was done by hand with another label set, such as
another number of segments, is kept in an attribute of its own, for the time when the labels are of that set again.
"""

from __future__ import annotations

from collections.abc import Mapping

import bpy
import numpy as np

from ...core.mesh.triangle_mesh import IntArray
from ..scene.attributes import new_attribute, read_face_ints, remove_attribute, write_attribute
from ..scene.simulations import check_may_change
from ..scene.vertex_group_access import free_name
from .ledger import Ledger
from .output import PartsOfMesh
from .part_attributes import labels_on

BY_HAND = "wks_segment_by_hand"
"""Face attribute: 1 more than the part that a face was given by hand; 0, which Blender gives to new faces, is none."""
MODEL_LABELS = "wks_segment_model"
"""Face attribute: the part that the model gives, where others were written."""
BY_HAND_ELSEWHERE = f"{BY_HAND}.other"
"""Face attributes: as above, of other label sets."""
OTHER_SETS = "by_hand_of_sets"
"""Entry of the ledger: names of the attributes with faces by hand of other label sets, by the keys of the sets."""


class ModelLabels:
    """The labels that the model gives, where a person changed them."""

    def write(self, mesh: bpy.types.Mesh, parts: PartsOfMesh, ledger: Ledger) -> None:
        """Keep the model's labels, if they differ from those that were written."""
        if not np.array_equal(parts.of_polygons, parts.by_model):
            ledger.add_attribute("model_labels", MODEL_LABELS, "INT", "FACE", parts.by_model)

    def take_back(self, mesh: bpy.types.Mesh, ledger: Ledger) -> None:
        """Remove the attribute."""
        ledger.remove_attribute("model_labels")


class ByHand:
    """The parts that faces were given by hand."""

    keys = ("by_hand", OTHER_SETS)

    def take_back(self, mesh: bpy.types.Mesh, ledger: Ledger) -> None:
        """Remove the attributes."""
        ledger.remove_attribute("by_hand")
        for name in ledger.get(OTHER_SETS, {}).values():
            remove_attribute(mesh, name)


def by_hand(mesh: bpy.types.Mesh) -> IntArray:
    """(p,) part that each polygon was given by hand, −1 for none."""
    kept = read_face_ints(mesh, Ledger(mesh).get("by_hand", ""))
    return np.full(len(mesh.polygons), -1) if kept is None else kept - 1


def faces_by_hand(mesh: bpy.types.Mesh) -> int:
    """Number of faces of a mesh that were given a part by hand, in any label set."""
    kept = (by_hand_of(mesh, labels) for labels in dict(Ledger(mesh).get(OTHER_SETS, {})))
    given = np.stack([by_hand(mesh), *(parts for parts in kept if parts is not None)]) >= 0
    return int(given.any(axis=0).sum())


def keep_by_hand(mesh: bpy.types.Mesh, parts: IntArray) -> None:
    """Keep the (p,) parts that the polygons of a mesh with labels were given by hand, −1 for none."""
    check_may_change(mesh)
    ledger = Ledger(mesh)
    attribute = ledger.attribute("by_hand")
    if not (parts >= 0).any():
        ledger.remove_attribute("by_hand")
        ledger.remove("by_hand")
    elif attribute is None:
        ledger.add_attribute("by_hand", BY_HAND, "INT", "FACE", parts + 1)
    else:
        write_attribute(attribute, parts + 1)


def by_hand_of(mesh: bpy.types.Mesh, labels: str) -> IntArray | None:
    """(p,) part that each polygon was given by hand when the labels were of another set, −1 for none; None if never."""
    kept = read_face_ints(mesh, dict(Ledger(mesh).get(OTHER_SETS, {})).get(labels, ""))
    return None if kept is None else kept - 1


def keep_by_hand_of(mesh: bpy.types.Mesh, labels: str, parts: IntArray) -> None:
    """Keep the (p,) parts that polygons were given by hand, −1 for none, for when the labels are of that set again."""
    check_may_change(mesh)
    ledger = Ledger(mesh)
    names = dict(ledger.get(OTHER_SETS, {}))
    remove_attribute(mesh, names.pop(labels, ""))
    if (parts >= 0).any():
        names[labels] = new_attribute(mesh, free_name(mesh, BY_HAND_ELSEWHERE), "INT", "FACE", parts + 1).name
    if names:
        ledger[OTHER_SETS] = names
    else:
        ledger.remove(OTHER_SETS)


def attributes_of_sets(mesh: bpy.types.Mesh) -> list[str]:
    """Names of the attributes that look like faces by hand of other label sets."""
    attributes = [each for each in mesh.attributes if (each.data_type, each.domain) == ("INT", "FACE")]
    return [each.name for each in attributes if each.name.startswith(BY_HAND_ELSEWHERE)]


def model_labels(mesh: bpy.types.Mesh) -> IntArray | None:
    """(p,) parts of polygons as the model gives them; None if there are no labels."""
    kept = read_face_ints(mesh, Ledger(mesh).get("model_labels", ""))
    return labels_on(mesh) if kept is None else kept


def keep_model_labels(mesh: bpy.types.Mesh, labels: IntArray) -> None:
    """Keep the (p,) parts that the model gives to a mesh whose labels were drawn."""
    ledger = Ledger(mesh)
    ledger.remove_attribute("model_labels")
    ledger.remove("model_labels")
    written = labels_on(mesh)
    if written is not None and not np.array_equal(labels, written):
        ledger.add_attribute("model_labels", MODEL_LABELS, "INT", "FACE", labels)


def merge_parts(labels: IntArray, merged_into: Mapping[int, int]) -> IntArray:
    """(p,) parts, where each part that is merged into another is replaced by that one."""
    replacement = np.arange(max(labels.max(initial=-1), *merged_into, -1) + 1)
    for part, other in merged_into.items():
        replacement[part] = other
    return np.asarray(replacement[labels])
