"""Parts as face sets, which Sculpt Mode shows."""

from __future__ import annotations

from collections.abc import Iterator

import bpy
import numpy as np

from ...core.mesh.triangle_mesh import BoolArray, IntArray
from ..parts import part_ids
from ..scene.attributes import read_attribute, read_face_ints, write_attribute
from .ledger import MARK, Ledger
from .output import PartsOfMesh
from .part_attributes import labels_on

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
        now = read_face_ints(mesh, FACE_SET_ATTRIBUTE)
        if now is not None:
            _restore(mesh, ledger, now)
        ledger.remove_attribute("own_face_sets")


def _restore(mesh: bpy.types.Mesh, ledger: Ledger, now: IntArray) -> None:
    own, written = (read_face_ints(mesh, ledger.get(key, "")) for key in ("own_face_sets", "written"))
    restored, is_ours = now.copy(), np.zeros(len(now), dtype=bool)
    highest = 0 if written is None else int(now[written == 0].max(initial=0))
    for faces, is_joined in _groups(ledger, written, len(now)):
        ours = _in_our_sets(mesh, ledger, now, own, faces) if is_joined else _in_listed_sets(ledger, now, faces)
        is_ours |= ours
        before = np.zeros_like(now) if own is None else own
        # As Blender does it, sets of an object that was joined get numbers above those of the others.
        shift = highest if is_joined else 0
        restored[ours] = np.where(before == NO_FACE_SET, FIRST_FACE_SET, before)[ours] + shift
        highest = max(highest, int(restored[ours].max(initial=0)))
    if own is None and is_ours.any() and (is_ours | (now == NO_FACE_SET)).all():
        mesh.attributes.remove(mesh.attributes[FACE_SET_ATTRIBUTE])
    elif is_ours.any():
        write_attribute(mesh.attributes[FACE_SET_ATTRIBUTE], restored)


def _groups(ledger: Ledger, written: IntArray | None, count: int) -> Iterator[tuple[BoolArray, bool]]:
    """The faces that were written to with this ledger, and those of each object that was joined, which is told."""
    if written is None:
        yield np.ones(count, dtype=bool), False
        return
    marks = np.unique(written[written != 0]).tolist()
    for mark in sorted(marks, key=lambda mark: mark != ledger.get(MARK, 0)):
        yield written == mark, mark != ledger.get(MARK, 0)


def _in_listed_sets(ledger: Ledger, now: IntArray, faces: BoolArray) -> BoolArray:
    return np.asarray(faces & np.isin(now, list(ledger.get("face_sets", []))))


def _in_our_sets(
    mesh: bpy.types.Mesh, ledger: Ledger, now: IntArray, own: IntArray | None, faces: BoolArray
) -> BoolArray:
    """Which faces of an object that was joined are in a set of ours: Blender has added a number to each."""
    labels = labels_on(mesh)
    if labels is None:
        return np.zeros_like(faces)
    wanted = labels + FIRST_FACE_SET
    added, count = np.unique((now - wanted)[faces], return_counts=True)
    had_sets = own is not None and bool((own[faces] != NO_FACE_SET).any())
    if len(added) > 1 and not had_sets:  # not written as face sets
        return np.zeros_like(faces)
    return np.asarray(faces & np.isin(now - added[count.argmax()], wanted[faces]))
