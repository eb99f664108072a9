"""Which bones together are a part: the rows of a tree that are parts of their own; every other one joins its parent."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from ..core.mesh.triangle_mesh import IntArray
from .bone_names import LEFT_SIDE, NO_SIDE, RIGHT_SIDE
from .bone_tree import TINY_BONE, BoneRow, BoneTree
from .dictionary import BROADER, DETAILS, MIDLINE, STANDARD, broader_names

SAME_NAME, DETAIL, SAME_REGION = 0.005, 0.1, 0.25
"""Factors of the area of a row that joins its parent: with the same name (a tail, a twist of a limb), as a detail
(fingers, face), and within the torso. The row with the least area so weighed joins first. Chosen by looking at the
parts of 21 rigs with 10 and with 12 parts."""
TELLING = 0.15
"""Share of a part's area below which a bone has no say in the part's name: a shoulder does not make an arm a torso."""
USUAL_NUMBER, MOSTLY_NAMED = 12, 0.5
"""Number of parts of a rig whose names say little, about as many as the standard parts of a person, and the share of
the area with known names above which names decide."""
SUFFIX_OF_SIDE = {NO_SIDE: "", LEFT_SIDE: ".L", RIGHT_SIDE: ".R"}


@dataclass(frozen=True)
class BonePart:
    """A named part of one or several meshes.

    Attributes
    ----------
    name : str
        Plain name without side.
    side : int
        0 for the middle or both sides, 1 for left, 2 for right.
    """

    name: str
    side: int

    @property
    def full_name(self) -> str:
        """The name with the suffix of its side, as Blender mirrors it."""
        return self.name + SUFFIX_OF_SIDE[self.side]


@dataclass(frozen=True, eq=False)
class PartsOfFaces:
    """The parts of several meshes, and the part of each face.

    Attributes
    ----------
    parts : list of BonePart
        Numbered by their place; all different.
    labels : list of (m,) int arrays
        For each mesh, the part of each face; −1 for a face without weights.
    """

    parts: list[BonePart]
    labels: list[IntArray]


def rows_by_number(rows: Sequence[BoneRow], number: int) -> frozenset[int]:
    """The rows that are parts so that there are so many, both sides of a pair counted once; fewer if the rig has fewer.

    Tiny rows are never parts.
    """
    own = set(range(len(rows)))
    area, above = [row.area for row in rows], [row.parent for row in rows]
    while len(own) > 1:
        costs = {row: _cost(rows[row].name, rows[above[row]].name, area[row]) for row in own if above[row] >= 0}
        least = min(costs, key=lambda row: (area[row] >= TINY_BONE, costs[row], row))
        if len(own) <= number and area[least] >= TINY_BONE:
            break
        own.remove(least)
        area[above[least]] += area[least]
        above = [above[least] if parent == least else parent for parent in above]
    return frozenset(own)


def rows_by_names(rows: Sequence[BoneRow], names: Collection[str]) -> frozenset[int]:
    """The rows that are parts so that the parts have some names, of those that the rig has."""
    own: set[int] = set()
    inherited: list[str | None] = []
    for i, row in enumerate(rows):
        above = None if row.parent < 0 else inherited[row.parent]
        wanted = _wanted(row.name, names)
        if row.parent < 0 or (wanted is not None and wanted != above):
            own.add(i)
        inherited.append(wanted or above)
    for i in sorted(own, reverse=True):
        members = np.flatnonzero(_owners(rows, own) == i)
        if rows[i].parent >= 0 and sum(rows[each].area for each in members) < TINY_BONE:
            own.remove(i)
    return frozenset(own)


def usual_rows(rows: Sequence[BoneRow]) -> tuple[frozenset[int], Collection[str]]:
    """The rows that are parts if nobody asks for a number, and the names that their parts get.

    They are the standard parts of people and animals, or `USUAL_NUMBER` parts of a rig with other names.
    """
    own = rows_by_names(rows, STANDARD)
    if len(own) > 2 and sum(row.area for row in rows if row.known) >= MOSTLY_NAMED:
        return own, STANDARD
    return rows_by_number(rows, USUAL_NUMBER), ()


def parts_of_faces(
    trees: Sequence[BoneTree],
    own: Sequence[Collection[int]],
    sides: bool = True,
    names: Sequence[Collection[str]] = (),
) -> PartsOfFaces:
    """Parts of several meshes, given the rows of each tree that are parts; parts with the same name are one.

    Parameters
    ----------
    trees, own
        The first row of a tree is always a part.
    sides : bool
        Whether left and right are two parts where the rig has bones on both sides.
    names
        For each tree, names that parts get where they fit, whatever bones they are of: those of `rows_by_names`.
    """
    numbers: dict[BonePart, int] = {}
    labels = []
    for tree, chosen, wanted in zip(trees, own, names or [()] * len(trees), strict=True):
        owner = _owners(tree.rows, chosen)
        name_of = _names(tree.rows, owner, wanted)
        of_faces = np.full(len(tree.areas), -1)
        moved = tree.row_of_faces >= 0
        part_row = np.where(moved, owner[tree.row_of_faces], -1)
        side = _sides(tree, part_row, name_of) if sides else np.zeros_like(part_row)
        for row in np.unique(part_row[moved]).tolist():
            for each in (NO_SIDE, LEFT_SIDE, RIGHT_SIDE):
                inside = (part_row == row) & (side == each)
                if inside.any():
                    of_faces[inside] = numbers.setdefault(BonePart(name_of[row], each), len(numbers))
        labels.append(of_faces)
    return PartsOfFaces(list(numbers), labels)


def _cost(name: str, into: str, area: float) -> float:
    """What it costs that a row joins another."""
    if name == into:
        return SAME_NAME * area
    if name in DETAILS and into in broader_names(name):
        return DETAIL * area
    if BROADER.get(name, name) == "Torso" == BROADER.get(into, into):
        return SAME_REGION * area
    return area


def _owners(rows: Sequence[BoneRow], own: Collection[int]) -> IntArray:
    """(rows,) the row that each row is a part of: itself, or the next one above that is a part, or the first row."""
    owners: list[int] = []
    for i, row in enumerate(rows):
        owners.append(i if i in own or row.parent < 0 else owners[row.parent])
    return np.array(owners)


def _sides(tree: BoneTree, part_row: IntArray, name_of: dict[int, str]) -> IntArray:
    """(m,) side of each face: that of its bone if its part is on both sides, else that of the part's own bone."""
    sides = np.zeros(len(part_row), dtype=np.int64)
    for row, name in name_of.items():
        inside = part_row == row
        if name not in MIDLINE:
            sides[inside] = tree.side_of_faces[inside] if tree.rows[row].is_pair else tree.rows[row].sides[0]
    return sides


def _names(rows: Sequence[BoneRow], owner: IntArray, names: Collection[str]) -> dict[int, str]:
    """A name for each row that is a part, all different among rows of one rig that do not have one of `names`."""
    found: dict[int, str] = {}
    taken: set[str] = set()
    for part in np.unique(owner).tolist():
        members = np.flatnonzero(owner == part).tolist()
        wanted = _wanted(_name_of(rows, members), names)
        if wanted is not None:
            found[part] = wanted
            continue
        base = name = _name_of(rows, members)
        count = 1
        while name in taken:
            count += 1
            name = f"{base}.{count}" if base[-1].isdigit() else f"{base} {count}"
        taken.add(name)
        found[part] = name
    return found


def _name_of(rows: Sequence[BoneRow], members: Sequence[int]) -> str:
    """Name of a part of some rows: the smallest that stands for all large ones of them, else that of the largest."""
    by_name: dict[str, float] = {}
    for row in members:
        by_name[rows[row].name] = by_name.get(rows[row].name, 0.0) + rows[row].area
    total = sum(by_name.values())
    largest = max(by_name, key=by_name.__getitem__)
    telling = [name for name, area in by_name.items() if area >= TELLING * total]
    for name in broader_names(largest):
        if all(name in broader_names(other) for other in telling):
            return name
    return largest


def _wanted(name: str, names: Collection[str]) -> str | None:
    """The one of some names that a plain name belongs to."""
    return next((each for each in broader_names(name) if each in names), None)
