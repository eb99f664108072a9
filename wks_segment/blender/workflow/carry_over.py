"""What a user made of labels goes with the labels from one label set to another.

A set is what one model gives with one number of segments. Names, colors, merges and faces by hand are kept by set, so
going back to a set gives back what was there. What is carried to a set for the first time follows the area: the
successor of a part covers more than half of the area that the two cover together.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import bpy
import numpy as np

from ...core.mesh.triangle_mesh import IntArray
from ..outputs.origin import origin_of
from ..outputs.overrides import by_hand, by_hand_of, keep_by_hand, keep_by_hand_of, model_labels
from ..outputs.part_materials import hand_over
from ..parts import part_ids
from ..parts.palette import MAX_COLORS
from ..parts.part_style import SetNotes
from ..props.changes import unheard
from ..props.label_set import is_known, notes_of, style_of
from ..props.settings import WKSSegmentSettings
from ..scene.attributes import Float32Array, read_floats
from ..scene.characters import Character, polygon_ranges
from .segment_list import make_part, restyle

SUCCESSOR_OVERLAP = 0.5
"""Common area of an old and a new part, as a share of what they cover together, above which the new part is the old
one's successor. At one half or more a part has at most one successor."""
AT_ARRIVAL = "<"
"""Key, of no label set, of the faces by hand when the labels of a mesh became those of their set."""


@dataclass(frozen=True)
class _Change:
    """A mesh whose labels become those of another set."""

    mesh: bpy.types.Mesh
    before: IntArray
    """(p,) part of each polygon by the model of the old set."""
    after: IntArray
    areas: Float32Array


def change_sets(settings: WKSSegmentSettings, labels: Mapping[Character, IntArray], new: str) -> None:
    """Carry over what a user made of meshes that get labels of another set; call it before they are written.

    Parameters
    ----------
    settings
    labels
        The new part of each polygon of each character.
    new : str
        Key of their label set.
    """
    changes: dict[str, list[_Change]] = {}
    for character, parts in labels.items():
        for obj, polygons in polygon_ranges(character):
            before, old = model_labels(obj.data), origin_of(obj.data).labels
            if before is not None and old != new and len(before):
                change = _Change(obj.data, before, parts[polygons], read_floats(obj.data.polygons, "area"))
                changes.setdefault(old, []).append(change)
    stored, known = notes_of(new), is_known(new)
    notes = stored
    successors = {old: _successors(meshes) for old, meshes in changes.items()}
    for i, (old, meshes) in enumerate(changes.items()):
        # A known set has the names of its own model; what was named with another number of segments is of that, too.
        if not known or part_ids.model_of(old) == part_ids.model_of(new):
            notes = _carried(notes_of(old), notes, successors[old], merges=not known)
        if not known and i == 0:
            notes = replace(notes, looks=_looks(old, new, meshes))
    # The palette belongs to the model: labels of a set that is known get its colors.
    settings.keep_notes(replace(notes, palette=notes.palette or settings.palette), new)
    with unheard():
        settings.palette = notes.palette or settings.palette
    if known and notes != stored:
        restyle(new)
    for old, meshes in changes.items():
        hand_over([each.mesh for each in meshes], old, new, successors[old])
        goes_on = not known or part_ids.model_of(old) == part_ids.model_of(new)
        to = {**successors[old], **(_made(notes_of(old)) if goes_on else {})}
        for change in {each.mesh: each for each in meshes}.values():
            _carry_faces(settings, change.mesh, old, new, to)


def _carried(old: SetNotes, new: SetNotes, successor: Mapping[int, int], merges: bool) -> SetNotes:
    """The notes on a new set, with those on the parts of an old one for their successors that have none yet."""
    to = {**successor, **_made(old)}
    taken = set(new.names.values())
    names = {to[part]: name for part, name in old.names.items() if part in to and name not in taken}
    colors = {to[part]: color for part, color in old.colors.items() if part in to}
    joined = {to[part]: to[into] for part, into in old.joined.items() if part in to and into in to}
    looks = {part: look for part, look in old.looks.items() if part >= part_ids.FIRST_MADE}
    return SetNotes(
        names | dict(new.names), colors | dict(new.colors), joined if merges and not new.joined else new.joined,
        looks | dict(new.looks), new.palette,
    )  # fmt: skip


def _made(notes: SetNotes) -> dict[int, int]:
    """The parts that a person made keep their numbers in other sets of the model."""
    parts = (*notes.names, *notes.colors)
    return {part: part for part in parts if part % part_ids.SIDE_STEP >= part_ids.FIRST_MADE}


def _looks(old: str, new: str, meshes: Sequence[_Change]) -> dict[int, int]:
    """Which color of the palette each segment of a new set has, so that the same parts keep theirs."""
    before = notes_of(old).looks
    n_segments = part_ids.number_of(new)
    if part_ids.model_of(old) == part_ids.model_of(new):
        # The same model with another number of segments: segments keep their numbers.
        same = {segment: segment for segment in range(min(n_segments, part_ids.number_of(old)))}
    else:
        segments = [
            replace(each, before=part_ids.segments_of(each.before), after=part_ids.segments_of(each.after))
            for each in meshes
        ]
        same = {after: segment for segment, after in _successors(segments).items()}
    wanted = {segment: before.get(other, other) for segment, other in same.items()}
    looks = {segment: look for segment, look in before.items() if segment >= part_ids.FIRST_MADE}
    free = [number for number in range(MAX_COLORS) if number not in wanted.values()]
    for segment in range(n_segments):
        look = wanted.get(segment)
        if look is None and free:
            look = segment if segment in free else free[0]
            free.remove(look)
        if look is not None and look != segment:
            looks[segment] = look
    return looks


def _carry_faces(settings: WKSSegmentSettings, mesh: bpy.types.Mesh, old: str, new: str, to: dict[int, int]) -> None:
    """Keep the faces by hand of the old set, and bring those of the new one.

    Where the labels were of the new set before, that is what was there, and in addition what was done by hand since.

    Parameters
    ----------
    to
        Successor of each part; gets those of parts that have none, which are made.
    """
    now, there = by_hand(mesh), by_hand_of(mesh, new)
    arrived = by_hand_of(mesh, AT_ARRIVAL)
    since = now != (-1 if arrived is None else arrived)
    for part in np.unique(now[now >= 0]).tolist():
        if part not in to and (there is None or since[now == part].any()):
            to[part] = make_part(settings, new, style_of(old).name_of(part), part // part_ids.SIDE_STEP)
    carried = np.array([to.get(part, -1) for part in now.tolist()], dtype=np.int64)
    keep_by_hand_of(mesh, old, now)
    final = carried if there is None else np.where(since, carried, there)
    keep_by_hand(mesh, final)
    keep_by_hand_of(mesh, AT_ARRIVAL, final)


def _successors(meshes: Sequence[_Change]) -> dict[int, int]:
    """Successor among new labels of each part of the old ones that has one."""
    if not meshes:
        return {}
    old_parts, row = np.unique(np.concatenate([each.before for each in meshes]), return_inverse=True)
    new_parts, column = np.unique(np.concatenate([each.after for each in meshes]), return_inverse=True)
    common = np.zeros((len(old_parts), len(new_parts)))
    np.add.at(common, (row.ravel(), column.ravel()), np.concatenate([each.areas for each in meshes]))
    either = common.sum(axis=1, keepdims=True) + common.sum(axis=0) - common
    rows, columns = np.nonzero(common > SUCCESSOR_OVERLAP * either)
    return dict(zip(old_parts[rows].tolist(), new_parts[columns].tolist(), strict=True))
