"""Borders that an artist has marked: sharp edges, seams and changes of material, without those that we wrote."""

from __future__ import annotations

from collections.abc import Collection

import bpy
import numpy as np

from ...core.mesh.triangle_mesh import IntArray
from ..scene.attributes import read_bools
from ..scene.characters import Character, polygon_ranges
from ..scene.topology import neighbors_at_edges, welded_edges
from .materials import own_material_index
from .seams import own_seams

SHARP_EDGES, MATERIAL_BORDERS = "sharp", "materials"
"""Kinds of marks in the setting `snap_to`; the third one is "seams"."""


def marked_pairs(character: Character, kinds: Collection[str]) -> IntArray | None:
    """(q, 2) pairs of neighboring polygons with a mark of one of these kinds between them; None without kinds.

    The polygons of all objects are numbered one object after another, as in `Pose.polygon_of`.
    """
    if not kinds:
        return None
    ranges = polygon_ranges(character)
    return np.concatenate([polygons.start + _pairs_of_mesh(obj.data, kinds) for obj, polygons in ranges])


def _pairs_of_mesh(mesh: bpy.types.Mesh, kinds: Collection[str]) -> IntArray:
    edge_number, n_edges = welded_edges(mesh)
    pairs, edge_between = neighbors_at_edges(mesh, edge_number)
    is_marked = np.zeros(len(pairs), dtype=bool)
    for kind in kinds:
        if kind == MATERIAL_BORDERS:
            is_marked |= np.diff(own_material_index(mesh)[pairs], axis=1).ravel() != 0
        else:
            marked_edges = np.zeros(n_edges, dtype=bool)
            own = read_bools(mesh.edges, "use_edge_sharp") if kind == SHARP_EDGES else own_seams(mesh)
            marked_edges[edge_number[own]] = True
            is_marked |= marked_edges[edge_between]
    return pairs[is_marked]
