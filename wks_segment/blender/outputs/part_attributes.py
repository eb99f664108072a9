"""The numbers of parts as integer attributes of faces and vertices, and which faces were written to."""

from __future__ import annotations

import bpy
import numpy as np

from ...core.mesh.triangle_mesh import IntArray
from ..scene.attributes import OUR_HIDDEN_ATTRIBUTE, read_face_ints, read_ints
from ..scene.topology import at_corners
from .ledger import MARK, Ledger, has_ledger
from .output import PartsOfMesh

FACE_ATTRIBUTE = "wks_segment"
VERTEX_ATTRIBUTE = "wks_segment_vertex"


class PartAttributes:
    """The part of each face, the part of most faces around each vertex, and a hidden mark on the faces written to."""

    def write(self, mesh: bpy.types.Mesh, parts: PartsOfMesh, ledger: Ledger) -> None:
        """Add the attributes."""
        ledger.add_attribute("faces", FACE_ATTRIBUTE, "INT", "FACE", parts.of_polygons)
        ledger.add_attribute("vertices", VERTEX_ATTRIBUTE, "INT", "POINT", _labels_of_vertices(mesh, parts.of_polygons))
        mark = np.full(len(mesh.polygons), ledger[MARK])
        ledger.add_attribute("written", OUR_HIDDEN_ATTRIBUTE, "INT", "FACE", mark)

    def take_back(self, mesh: bpy.types.Mesh, ledger: Ledger) -> None:
        """Remove the attributes."""
        ledger.remove_attribute("faces")
        ledger.remove_attribute("vertices")
        ledger.remove_attribute("written")


def has_labels(mesh: bpy.types.Mesh) -> bool:
    """Whether a mesh carries anything that we wrote."""
    return has_ledger(mesh) or OUR_HIDDEN_ATTRIBUTE in mesh.attributes


def labels_on(mesh: bpy.types.Mesh) -> IntArray | None:
    """(p,) parts of a mesh's polygons as they were written; None if there are none."""
    return read_face_ints(mesh, label_attribute(mesh))


def label_attribute(mesh: bpy.types.Mesh) -> str:
    """Name of the attribute with the parts of a mesh's polygons; empty if there is none."""
    # A mesh without labels that was joined with labeled ones has their attributes and no ledger.
    joined = FACE_ATTRIBUTE if OUR_HIDDEN_ATTRIBUTE in mesh.attributes else ""
    return str(Ledger(mesh).get("faces", joined))


def _labels_of_vertices(mesh: bpy.types.Mesh, labels: IntArray) -> IntArray:
    """(n,) label that most of the faces around each vertex have; 0 at a vertex without a face."""
    distinct, column = np.unique(labels, return_inverse=True)
    count = np.zeros((len(mesh.vertices), len(distinct)), dtype=np.int32)
    np.add.at(count, (read_ints(mesh.loops, "vertex_index"), at_corners(mesh, column.ravel())), 1)
    return np.where(count.any(axis=1), distinct[count.argmax(axis=1)], 0)
