"""The tree of bones in the panel: its rows, and which of them are parts."""

from __future__ import annotations

import json
from collections.abc import Collection, Sequence

from ...rigs import BoneRow, BoneTree, rows_by_names, rows_by_number, usual_rows
from ..props.changes import unheard
from ..props.settings import WKSSegmentSettings

OPEN_DEPTH = 2
"""Rows that hang on fewer rows than this are open at first: torso, neck and the limbs are seen, fingers are not."""


def fill(settings: WKSSegmentSettings, tree: BoneTree) -> None:
    """Show the tree of a character, and choose its parts by the settings; the rows of the same rig stay as they are."""
    if not is_shown(settings, tree):
        with unheard():
            settings.bones.clear()
            for i, row in enumerate(tree.rows):
                item = settings.bones.add()
                item.name, item.bones = row.name, _key(tree, row)
                item.parent, item.depth, item.area = row.parent, len(tree.path(i)) - 1, row.area
                item.known, item.pair = row.known, row.is_pair
                item.open = item.depth < OPEN_DEPTH
            settings.active_bone = 0
        choose(settings)


def is_shown(settings: WKSSegmentSettings, tree: BoneTree) -> bool:
    """Whether the rows are of the same rig as a tree."""
    return [item.bones for item in settings.bones] == [_key(tree, row) for row in tree.rows]


def choose(settings: WKSSegmentSettings) -> None:
    """Choose the parts among the rows anew, as many as the settings ask for."""
    rows = [
        BoneRow(item.name, item.known, (), (1, 2) if item.pair else (0,), item.parent, item.area)
        for item in settings.bones
    ]
    if not rows:
        return
    own, _ = _chosen_by_settings(rows, settings)
    with unheard():
        for i, item in enumerate(settings.bones):
            item.own = i in own


def count_chosen(settings: WKSSegmentSettings) -> None:
    """Show the number of chosen rows in the field, since the user has chosen them one by one."""
    with unheard():
        settings.usual_parts = False
        settings.bone_parts = max(2, sum(item.own or item.parent < 0 for item in settings.bones))


def own_rows(
    trees: Sequence[BoneTree], settings: WKSSegmentSettings
) -> tuple[list[frozenset[int]], list[Collection[str]]]:
    """For each tree the rows that are parts, and the names that its parts are to have.

    The parts of the first tree are chosen by the list or by the settings. Those of another rig have their names.
    """
    own: list[frozenset[int]] = []
    names: list[Collection[str]] = []
    for tree in trees:
        alike = next((i for i, other in enumerate(trees[: len(own)]) if _keys(other) == _keys(tree)), None)
        if alike is not None:
            found, wanted = own[alike], names[alike]
        elif is_shown(settings, tree) and not settings.usual_parts:
            found, wanted = frozenset(i for i, item in enumerate(settings.bones) if item.own), ()
        elif not own or settings.usual_parts:
            found, wanted = _chosen_by_settings(tree.rows, settings)
        else:
            wanted = {trees[0].rows[row].name for row in own[0]}
            found = rows_by_names(tree.rows, wanted)
        own.append(found)
        names.append(wanted)
    return own, names


def _chosen_by_settings(
    rows: Sequence[BoneRow], settings: WKSSegmentSettings
) -> tuple[frozenset[int], Collection[str]]:
    """The rows that are parts by the settings alone, and the names that the parts are to have."""
    return usual_rows(rows) if settings.usual_parts else (rows_by_number(rows, settings.bone_parts), ())


def _keys(tree: BoneTree) -> list[str]:
    return [_key(tree, row) for row in tree.rows]


def _key(tree: BoneTree, row: BoneRow) -> str:
    """The bones of a row by their names, as JSON."""
    return json.dumps([tree.skeleton.bones[bone] for bone in row.bones])
