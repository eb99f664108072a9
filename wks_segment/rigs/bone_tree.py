"""The tree of the bones that move a character's surface: both bones of a pair are one row, and each row has one parent.

Bones without weights (controls, targets of inverse kinematics) are left out. Rigs for games often hang a foot on the
root, so that it can be held to the ground: a row that does not touch what it hangs on is hung on what it touches.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..core.mesh.triangle_mesh import BoolArray, FloatArray, IntArray
from ..core.message import Message
from .bone_names import LEFT_SIDE, NO_SIDE, RIGHT_SIDE
from .dictionary import ABOVE, LOWER_OF
from .skeleton import Skeleton
from .skin import Skin

TINY_BONE = 0.003
"""Share of the area below which bones are never a part: at most a finger tip on the rigs that this was tried on."""


@dataclass(frozen=True)
class BoneRow:
    """A bone, or a pair of bones on both sides.

    Attributes
    ----------
    name : str
        Plain name.
    known : bool
        Whether the dictionary has the name.
    bones : tuple of int
        One bone, or the left and the right one; and tiny bones that count as these.
    sides : tuple of int
        Side of each of them.
    parent : int
        Index of the row that it hangs on, −1 for the first row.
    area : float
        Share of the character's area, of both sides together.
    """

    name: str
    known: bool
    bones: tuple[int, ...]
    sides: tuple[int, ...]
    parent: int
    area: float

    @property
    def is_pair(self) -> bool:
        """Whether the row is on both sides."""
        return {LEFT_SIDE, RIGHT_SIDE} <= set(self.sides)


@dataclass(frozen=True, eq=False)
class BoneTree:
    """Rows of bones, parents before their children, and the row of each face.

    Attributes
    ----------
    skeleton : Skeleton
    rows : tuple of BoneRow
    row_of_faces, side_of_faces : (m,) int arrays
        Row and side of each face; −1 and 0 for a face without weights.
    areas : (m,) array
        Areas of the faces.
    """

    skeleton: Skeleton
    rows: tuple[BoneRow, ...]
    row_of_faces: IntArray
    side_of_faces: IntArray
    areas: FloatArray

    @classmethod
    def of(cls, skeleton: Skeleton, skin: Skin) -> BoneTree:
        """Build the tree; ValueError if no bone moves a face, or one bone moves all."""
        bone_of_faces = skin.bone_of_faces()
        moved = bone_of_faces >= 0
        if not skeleton.bones:
            raise ValueError("there is no bone: parts from bones need an armature")
        if not moved.any():
            raise ValueError(
                Message(
                    "none of the {count} bones has weights on the mesh: weight the mesh first (Parent > With Automatic "
                    "Weights), or take the parts from something else",
                    count=len(skeleton.bones),
                )
            )
        area: FloatArray = np.bincount(bone_of_faces[moved], skin.areas[moved], len(skeleton.bones)).astype(np.float64)
        area /= area.sum() or 1.0
        used = np.bincount(bone_of_faces[moved], minlength=len(skeleton.bones)) > 0
        if used.sum() < 2:
            raise ValueError(
                Message(
                    'only the bone "{bone}" moves the mesh: there is nothing to divide it by',
                    bone=skeleton.bones[int(used.argmax())],
                )
            )
        groups, group_of = _groups(skeleton, used)
        of_faces = np.where(moved, group_of[bone_of_faces], -1)
        touching = skin.borders(of_faces, len(groups))
        parents = _parents(skeleton, groups, group_of, touching, area)
        rows, row_of_group = _rows(skeleton, groups, parents, area)
        sides = np.array(skeleton.sides())
        return cls(
            skeleton, rows, np.where(moved, row_of_group[of_faces], -1), np.where(moved, sides[bone_of_faces], NO_SIDE),
            skin.areas,
        )  # fmt: skip

    def path(self, row: int) -> list[int]:
        """A row and all that it hangs on, up to the first row."""
        found = [row]
        while self.rows[found[-1]].parent >= 0:
            found.append(self.rows[found[-1]].parent)
        return found

    def named_area(self) -> float:
        """Share of the area of bones whose names the dictionary has."""
        return sum(row.area for row in self.rows if row.known)


def _groups(skeleton: Skeleton, used: BoolArray) -> tuple[list[tuple[int, ...]], IntArray]:
    """The used bones, both of a pair together, and the group of each bone, −1 for none."""
    mirrored = {left: right for left, right in skeleton.mirrored().items() if used[left] or used[right]}
    rights = set(mirrored.values())
    groups: list[tuple[int, ...]] = []
    group_of = np.full(len(skeleton.bones), -1, dtype=np.int64)
    for bone in range(len(skeleton.bones)):
        if bone in rights or not (used[bone] or bone in mirrored):
            continue
        pair: tuple[int, ...] = (bone, mirrored[bone]) if bone in mirrored else (bone,)
        group_of[list(pair)] = len(groups)
        groups.append(pair)
    return groups, group_of


def _parents(
    skeleton: Skeleton, groups: list[tuple[int, ...]], group_of: IntArray, touching: FloatArray, area: FloatArray
) -> list[int]:
    """The group that each group hangs on, −1 for one of them, to which everything leads."""
    areas = [sum(area[bone] for bone in group) for group in groups]
    parents = [_above(skeleton, group, group_of) for group in groups]
    names = [skeleton.names[group[0]] for group in groups]
    trunk = _trunk(parents, areas)
    for i, group in enumerate(groups):
        if i == trunk or (parents[i] >= 0 and touching[i, parents[i]]):
            continue
        wanted = ABOVE.get(names[i].name)
        limb = [j for j, other in enumerate(groups) if len(other) == len(group) and names[j].name == wanted]
        touched = [j for j in np.flatnonzero(touching[i]).tolist() if len(groups[j]) <= len(group)]
        limb, touched = ([j for j in found if i not in _path(parents, j)] for found in (limb, touched))
        if touched:
            parents[i] = touched[int(np.argmax(touching[i, touched]))]
        elif len(limb) == 1:
            parents[i] = limb[0]
        elif parents[i] < 0:
            parents[i] = trunk
    return parents


def _above(skeleton: Skeleton, group: tuple[int, ...], group_of: IntArray) -> int:
    """The group of the first used bone above the first bone of a group, −1 if there is none."""
    bone = skeleton.parents[group[0]]
    while bone >= 0 and (group_of[bone] < 0 or group_of[bone] == group_of[group[0]]):
        bone = skeleton.parents[bone]
    return -1 if bone < 0 else int(group_of[bone])


def _trunk(parents: list[int], areas: list[float]) -> int:
    """The group without a parent that most area hangs on."""
    below = [0.0] * len(parents)
    for i, area in enumerate(areas):
        below[_path(parents, i)[-1]] += area
    return max(range(len(parents)), key=below.__getitem__)


def _path(parents: list[int], group: int) -> list[int]:
    """A group and those that it hangs on."""
    found = [group]
    while parents[found[-1]] >= 0:
        found.append(parents[found[-1]])
    return found


def _in_limb(name: str, above: str) -> str:
    """The name of a row: below a part of a limb, what is named as the whole limb is its lower part."""
    lower = LOWER_OF.get(name, "")
    return lower if lower and above in (lower, ABOVE.get(lower)) else name


def _rows(
    skeleton: Skeleton, groups: list[tuple[int, ...]], parents: list[int], area: FloatArray
) -> tuple[tuple[BoneRow, ...], IntArray]:
    """Rows in the order of the tree, and the row of each group; a tiny first group is one with its largest child."""
    areas = [float(sum(area[bone] for bone in group)) for group in groups]
    children: dict[int, list[int]] = {}
    for i, parent in enumerate(parents):
        children.setdefault(parent, []).append(i)
    rows: list[BoneRow] = []
    sides = skeleton.sides()
    row_of = np.full(len(groups), -1)
    waiting = [(i, -1) for i in reversed(children[-1])]
    while waiting:
        group, parent = waiting.pop()
        named = skeleton.names[groups[group][0]]
        name = _in_limb(named.name, rows[parent].name if parent >= 0 else "")
        row = BoneRow(name, named.known, groups[group], tuple(sides[b] for b in groups[group]), parent, areas[group])
        row_of[group] = len(rows)
        below = children.get(group, [])
        single = [child for child in below if len(groups[child]) == 1]
        if parent < 0 and row.area < TINY_BONE and single:
            heir = max(single, key=areas.__getitem__)
            named = skeleton.names[groups[heir][0]]
            row = replace(
                row, name=named.name, known=named.known, bones=(*groups[heir], *row.bones),
                sides=(sides[groups[heir][0]], *row.sides), area=row.area + areas[heir],
            )  # fmt: skip
            row_of[heir] = len(rows)
            below = [*(child for child in below if child != heir), *children.get(heir, [])]
        waiting += [(child, len(rows)) for child in reversed(below)]
        rows.append(row)
    return tuple(rows), row_of
