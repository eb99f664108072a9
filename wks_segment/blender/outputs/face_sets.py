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
NOT_WRITTEN = 0
"""Mark on faces that were joined or drawn where there were no labels."""


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
    groups = []
    for faces, is_joined in _groups(ledger, written, len(now)):
        ours = _in_our_sets(mesh, ledger, now, own, faces) if is_joined else _in_listed_sets(ledger, now, faces)
        groups.append((faces, is_joined, ours))
    if not any(ours.any() for _, _, ours in groups):
        return
    if own is None and all(_is_nothing_of_the_artist(now, *group) for group in groups):
        mesh.attributes.remove(mesh.attributes[FACE_SET_ATTRIBUTE])
        return
    before = np.zeros_like(now) if own is None else own
    before = np.where(before == NO_FACE_SET, FIRST_FACE_SET, before)
    restored, highest = now.copy(), 0
    for faces, is_joined, ours in groups:
        # As Blender does it, sets of an object that was joined get numbers above those of the others.
        restored[ours] = before[ours] + (highest if is_joined else 0)
        highest = max(highest, int(restored[ours].max(initial=0)))
        others = faces & ~ours & (now != NO_FACE_SET)
        if now[others].min(initial=highest + 1) <= highest:  # it would become one set with another one
            restored[others] += highest
        highest = max(highest, int(restored[others].max(initial=0)))
    write_attribute(mesh.attributes[FACE_SET_ATTRIBUTE], restored)


def _groups(ledger: Ledger, written: IntArray | None, count: int) -> Iterator[tuple[BoolArray, bool]]:
    """The faces that were written to with this ledger, and those of each object that was joined, which is told."""
    if written is None:
        yield np.ones(count, dtype=bool), False
        return
    mark = ledger.get(MARK, NOT_WRITTEN)
    for other in sorted(np.unique(written).tolist(), key=lambda other: other != mark):
        yield written == other, other != mark


def _is_nothing_of_the_artist(now: IntArray, faces: BoolArray, is_joined: bool, ours: BoolArray) -> bool:
    """Whether faces of an object were without sets, so that Blender has put all of them into one when it was joined."""
    others = now[faces & ~ours]
    return bool((others == NO_FACE_SET).all()) or (is_joined and not ours.any() and len(np.unique(others)) == 1)


def _in_listed_sets(ledger: Ledger, now: IntArray, faces: BoolArray) -> BoolArray:
    return np.asarray(faces & np.isin(now, list(ledger.get("face_sets", []))))


def _in_our_sets(
    mesh: bpy.types.Mesh, ledger: Ledger, now: IntArray, own: IntArray | None, faces: BoolArray
) -> BoolArray:
    """Which faces of an object that was joined are in a set of ours: Blender has added a number to each."""
    labels, written = labels_on(mesh), read_face_ints(mesh, ledger.get("written", ""))
    if labels is None or written is None or (written[faces] == NOT_WRITTEN).any():
        return np.zeros_like(faces)
    wanted = labels + FIRST_FACE_SET
    if own is None or (own[faces] == NO_FACE_SET).all():
        # All of a part are in one set, or they were not written as face sets. Blender 4.2 does not add the same to all.
        pairs = np.unique(np.stack([wanted, now], axis=1)[faces], axis=0)
        return faces if len(pairs) == len(np.unique(pairs[:, 0])) else np.zeros_like(faces)
    added, count = np.unique((now - wanted)[faces], return_counts=True)
    return np.asarray(faces & np.isin(now - added[count.argmax()], wanted[faces]))
