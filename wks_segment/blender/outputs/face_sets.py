"""Parts as face sets, which Sculpt Mode shows."""

from __future__ import annotations

import bpy
import numpy as np

from ..parts import part_ids
from ..scene.attributes import read_attribute, write_attribute
from .ledger import Ledger
from .output import PartsOfMesh

FACE_SET_ATTRIBUTE = ".sculpt_face_set"
"""Blender's own face attribute: the number of the face set, from 1."""
OWN_FACE_SETS = "wks_segment_own_face_set"
"""Face attribute that keeps the face set that each face had before ours."""
FIRST_FACE_SET = 1
"""Face set of part 0; Blender counts face sets from 1."""

NO_FACE_SET = 0
"""Number on faces that were joined or drawn where Blender had no face sets."""


class FaceSets:
    """A face set for each part, in place of the artist's own face sets."""

    def write(self, mesh: bpy.types.Mesh, parts: PartsOfMesh, ledger: Ledger) -> None:
        """Put each polygon into the face set of its part, if the options ask for face sets."""
        if not parts.options.face_sets:
            return
        own = read_attribute(mesh, FACE_SET_ATTRIBUTE)
        if own is None:
            mesh.attributes.new(FACE_SET_ATTRIBUTE, "INT", "FACE")
        else:
            ledger.add_attribute("own_face_sets", OWN_FACE_SETS, "INT", "FACE", own)
        ledger["face_sets"] = [part + FIRST_FACE_SET for part in part_ids.unique_parts(parts.of_polygons)]
        write_attribute(mesh.attributes[FACE_SET_ATTRIBUTE], parts.of_polygons + FIRST_FACE_SET)

    def take_back(self, mesh: bpy.types.Mesh, ledger: Ledger) -> None:
        """Give faces that are still in a face set of ours their own back; sets that the artist drew since stay."""
        _restore(mesh, ledger)
        ledger.remove_attribute("own_face_sets")


def _restore(mesh: bpy.types.Mesh, ledger: Ledger) -> None:
    now = read_attribute(mesh, FACE_SET_ATTRIBUTE)
    if "face_sets" not in ledger or now is None:
        return
    is_ours = np.isin(now, list(ledger["face_sets"]))
    written = read_attribute(mesh, ledger.get("written", ""))
    if written is not None:  # faces of an object that was joined can be in sets with the same numbers
        is_ours &= written != 0
    own = read_attribute(mesh, ledger.get("own_face_sets", ""))
    if own is None and (is_ours | (now == NO_FACE_SET)).all():
        mesh.attributes.remove(mesh.attributes[FACE_SET_ATTRIBUTE])
        return
    now[is_ours] = FIRST_FACE_SET if own is None else np.where(own == NO_FACE_SET, FIRST_FACE_SET, own)[is_ours]
    write_attribute(mesh.attributes[FACE_SET_ATTRIBUTE], now)
