"""Writes labels to a mesh and takes them back. A note on the mesh says what, so that Clear removes just that."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import bpy
import numpy as np

from ...core.mesh.triangle_mesh import FloatArray, IntArray
from ..parts.part_style import PLAIN, Style
from ..scene.attributes import read_face_ints, read_ints, write_attribute
from ..scene.topology import at_corners
from .face_sets import remove_face_sets, write_face_sets
from .id_map import remove_id_map
from .ledger import NOTE, add_attribute, has_note, note_of
from .materials import remove_materials, write_materials
from .seams import remove_seams, write_seams
from .uv_maps import remove_uv_map
from .vertex_groups import active_group, free_name, remove_groups, write_groups

FACES = "wks_segment"
VERTICES = "wks_segment_vertex"
COLORS = "wks_segment_color"
ATTRIBUTES = ("faces", "vertices", "colors", "own_materials", "own_face_sets", "seams", "model_labels")
"""Keys of the note under which names of attributes stand."""
LASTING = ("uv_map", "active_uv", "id_map", "by_hand")
"""Keys of the note on what operators of their own made: new labels leave it alone, Clear takes it back."""


def write_labels(
    mesh: bpy.types.Mesh, labels: IntArray, colors: bool = True, materials: bool = False,
    weights: Mapping[int, FloatArray] | None = None, style: Style = PLAIN,
    face_sets: bool = False, seams: bool = False, template: bpy.types.Material | None = None,
) -> None:  # fmt: skip
    """Write (p,) parts of polygons to a mesh, in the place of what an earlier run wrote.

    Faces and vertices get an int attribute each; optionally a color attribute of the corners, material slots behind
    the mesh's own (of copies of the template, if there is one), a vertex group for each part whose (n,) weights are not
    all 0, face sets, and seams on the borders. Attributes and groups of the user that happen to have our names are
    left alone: ours get a number.
    """
    shown = None if weights is None else active_group(mesh)
    note = note_of(mesh)
    _take_back(mesh, note)
    # The note comes first and grows with what is written, so that Clear also mends a run that broke off.
    mesh[NOTE] = {key: note[key] for key in LASTING if key in note}
    add_attribute(mesh, "faces", FACES, "INT", "FACE", labels.astype(np.int32))
    add_attribute(mesh, "vertices", VERTICES, "INT", "POINT", _at_vertices(mesh, labels).astype(np.int32))
    if colors:
        active = mesh.color_attributes.active_color
        mesh[NOTE]["active_color"] = active.name if active is not None else ""
        _write_colors(mesh, labels, style)
    if materials:
        write_materials(mesh, labels, style, template)
    if weights is not None:
        write_groups(mesh, weights, mesh[NOTE], style, shown)
    if face_sets:
        write_face_sets(mesh, labels)
    if seams:
        write_seams(mesh, labels)
    mesh.update()


def clear_labels(mesh: bpy.types.Mesh) -> bool:
    """Remove exactly what is ours on a mesh and restore what was there; False if there was nothing."""
    if not has_labels(mesh):
        return False
    note = note_of(mesh)
    _take_back(mesh, note)
    remove_uv_map(mesh, note)
    by_hand = mesh.attributes.get(note.get("by_hand", ""))
    if by_hand is not None:
        mesh.attributes.remove(by_hand)
    del mesh[NOTE]
    remove_id_map(note)
    mesh.update()
    return True


def has_labels(mesh: bpy.types.Mesh) -> bool:
    """Whether a mesh carries anything that is ours."""
    return has_note(mesh)


def labels_on(mesh: bpy.types.Mesh) -> IntArray | None:
    """(p,) parts of a mesh's polygons, as they were written; None if there are none."""
    return read_face_ints(mesh, note_of(mesh).get("faces", ""))


def _take_back(mesh: bpy.types.Mesh, note: dict[str, Any]) -> None:
    """Remove what `write_labels` wrote."""
    remove_materials(mesh, note)
    remove_face_sets(mesh, note)
    remove_seams(mesh, note)
    for key in ATTRIBUTES:
        attribute = mesh.attributes.get(note.get(key, ""))
        if attribute is not None:
            mesh.attributes.remove(attribute)
    # In 5.2 their names outlive the attribute that was active.
    for kind in ("active_color_name", "default_color_name"):
        if "colors" in note and getattr(mesh.attributes, kind) == note["colors"]:
            setattr(mesh.attributes, kind, "")
    active = mesh.color_attributes.get(note.get("active_color", ""))
    if active is not None:
        mesh.color_attributes.active_color = active
    remove_groups(mesh, note)


def _at_vertices(mesh: bpy.types.Mesh, labels: IntArray) -> IntArray:
    """(n,) the label that most of the faces around each vertex have; 0 at a vertex without a face."""
    found, column = np.unique(labels, return_inverse=True)
    count = np.zeros((len(mesh.vertices), len(found)), dtype=np.int32)
    np.add.at(count, (read_ints(mesh.loops, "vertex_index"), at_corners(mesh, column.ravel())), 1)
    return np.where(count.any(axis=1), found[count.argmax(axis=1)], 0)


def _write_colors(mesh: bpy.types.Mesh, labels: IntArray, style: Style) -> None:
    # Corners, since colors of the FACE domain cannot be shown, and those of points would blend.
    attribute = mesh.color_attributes.new(free_name(mesh, COLORS), "BYTE_COLOR", "CORNER")
    mesh[NOTE]["colors"] = attribute.name
    colors = np.ones((len(mesh.loops), 4), dtype=np.float32)
    colors[:, :3] = style.colors_of(at_corners(mesh, labels))
    write_attribute(attribute, colors)
    # What is rendered stays the user's, if there was something: only what is shown in solid view changes.
    if mesh.color_attributes.render_color_index < 0:
        mesh.color_attributes.render_color_index = mesh.color_attributes.find(attribute.name)
    mesh.color_attributes.active_color = attribute
