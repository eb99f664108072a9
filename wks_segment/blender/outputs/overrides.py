"""What a person changed of the parts that a model gives: faces by hand, parts joined. It outlasts new labels.

A face attribute keeps the part that each face was given by hand. Where that, or joined parts, make labels other than
the model's, another one keeps the model's, to go back to.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager

import bpy
import numpy as np
from scipy.spatial import cKDTree

from ...core.mesh.triangle_mesh import FloatArray, IntArray
from ..parts import part_ids
from ..parts.part_style import Style
from ..scene.attributes import read_face_ints, read_floats, write_attribute
from .labels import labels_on, write_labels
from .ledger import NOTE, add_attribute, note_of
from .materials import COMPONENT, template_of
from .vertex_groups import read_groups
from .vertex_weights import hard_weights

BY_HAND = "wks_segment_by_hand"
"""Face attribute: 1 more than the part that a face was given by hand; 0, which Blender gives to new faces, is none."""
MODEL_LABELS = "wks_segment_model"
"""Face attribute: the part that the model gives, where others were written."""


def by_hand(mesh: bpy.types.Mesh) -> IntArray:
    """(p,) part that each polygon was given by hand, −1 for none."""
    kept = read_face_ints(mesh, note_of(mesh).get("by_hand", ""))
    return np.full(len(mesh.polygons), -1) if kept is None else kept - 1


def keep_by_hand(mesh: bpy.types.Mesh, given: IntArray) -> None:
    """Keep the (p,) parts that polygons of a mesh with labels were given by hand, −1 for none."""
    _keep(mesh, "by_hand", BY_HAND, given + 1 if (given >= 0).any() else None)


def model_labels(mesh: bpy.types.Mesh) -> IntArray | None:
    """(p,) parts of polygons as the model gives them; None if there are no labels."""
    kept = read_face_ints(mesh, note_of(mesh).get("model_labels", ""))
    return labels_on(mesh) if kept is None else kept


def merged(labels: IntArray, joined: Mapping[int, int]) -> IntArray:
    """(p,) parts, for each that is joined with another the other."""
    of = np.arange(max(labels.max(initial=-1), *joined, -1) + 1)
    for part, other in joined.items():
        of[part] = other
    return np.asarray(of[labels])


def write_edited(
    mesh: bpy.types.Mesh, labels: IntArray, style: Style, joined: Mapping[int, int], colors: bool, materials: bool,
    weights: Mapping[int, FloatArray] | None = None, hard: bool = False,
    face_sets: bool = False, seams: bool = False, template: bpy.types.Material | None = None,
) -> IntArray:  # fmt: skip
    """Write (p,) parts that a model gives, with a person's edits, to a mesh; gives the parts as they were written.

    Parameters
    ----------
    weights
        The (n,) weights of the parts as the model gives them; they follow the edits.
    hard
        Write hard weights instead.
    """
    given = by_hand(mesh)
    final = merged(np.where(given < 0, labels, given), joined)
    if hard:
        weights = hard_weights(mesh, final)
    elif weights is not None:
        weights = moved(mesh, weights, labels, final)
    write_labels(mesh, final, colors, materials, weights, style, face_sets, seams, template)
    _keep(mesh, "model_labels", MODEL_LABELS, None if np.array_equal(final, labels) else labels)
    return final


def rewrite(mesh: bpy.types.Mesh, style: Style, joined: Mapping[int, int]) -> None:
    """Write the labels of a mesh, and all that was written with them, anew: its edits have changed."""
    labels, before, note = model_labels(mesh), labels_on(mesh), note_of(mesh)
    if labels is None or before is None:
        return
    weights, hard = None, False
    if "vertex_groups" in note:
        weights = read_groups(mesh, note)
        was = hard_weights(mesh, before)
        hard = weights.keys() == was.keys() and all(np.array_equal(weights[part], was[part]) for part in was)
        # Weights are of the parts before; what the model gives stands for them.
        weights = moved(mesh, weights, before, labels)
    with _materials_kept(mesh):
        write_edited(
            mesh, labels, style, joined, "colors" in note, "first_slot" in note, weights, hard,
            "face_sets" in note, "seams" in note, template_of(mesh),
        )  # fmt: skip


def moved(
    mesh: bpy.types.Mesh, weights: Mapping[int, FloatArray], before: IntArray, after: IntArray
) -> dict[int, FloatArray]:  # fmt: skip
    """Weights of parts at (n,) vertices after (p,) polygons changed from some parts to others.

    The weight of a part goes to what the nearest polygon of that part has become.
    """
    result: dict[int, FloatArray] = {}
    vertices, centers = read_floats(mesh.vertices, "co", 3), read_floats(mesh.polygons, "center", 3)
    for part, of_part in weights.items():
        mine = np.flatnonzero(before == part)
        found = part_ids.unique_parts(after[mine]) or [part]
        nearest = np.full(len(vertices), found[0])
        if len(found) > 1:
            nearest = after[mine[cKDTree(centers[mine]).query(vertices)[1]]]
        for new in found:
            result[new] = result.get(new, 0.0) + np.where(nearest == new, of_part, 0.0)
    return result


def _keep(mesh: bpy.types.Mesh, key: str, name: str, values: IntArray | None) -> None:
    """Let an int attribute of faces that is ours hold these values; None removes it."""
    attribute = mesh.attributes.get(note_of(mesh).get(key, ""))
    if values is None:
        if attribute is not None:
            mesh.attributes.remove(attribute)
        mesh[NOTE].pop(key, None)
    elif attribute is None:
        add_attribute(mesh, key, name, "INT", "FACE", values.astype(np.int32))
    else:
        write_attribute(attribute, values)


@contextmanager
def _materials_kept(mesh: bpy.types.Mesh) -> Iterator[None]:
    """While it lasts, no material of ours on the mesh goes: what the artist changed of it stays."""
    ours = [material for material in mesh.materials if material is not None and COMPONENT in material]
    before = [material.use_fake_user for material in ours]
    for material in ours:
        material.use_fake_user = True
    try:
        yield
    finally:
        for material, fake in zip(ours, before, strict=True):
            material.use_fake_user = fake
            if material.users == 0:
                bpy.data.materials.remove(material)
