"""Which bone each face of a rigged character belongs to, as a rigger's idea of its parts.

Needs no Blender: the bones come as names and parents.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from wks_segment.core.mesh.triangle_mesh import FloatArray, IntArray

SMALLEST_BONE = 0.01
"""Share of the area below which a bone counts as its parent: fingers and toes are no parts at eight segments."""
SIDE = re.compile(
    r"(?<![A-Za-z0-9])(?:left|right|l|r)(?![A-Za-z])"  # left_arm, arm.L, l-frontleg, r1
    r"|(?<=[a-z0-9])(?:Left|Right)(?![a-z])"  # ArmLeft
    r"|(?<![A-Za-z0-9])(?:Left|Right)(?=[A-Z])"  # LeftArm
    r"|(?<![A-Za-z0-9])(?:Left|Right|LEFT|RIGHT|L|R)(?![A-Za-z])"  # Left leg, L_Arm
    r"|(?<=[a-z0-9])(?:L|R)(?![A-Za-z0-9])"  # UpperArmL
)
"""The word or letter for a side in the name of a bone."""


@dataclass(frozen=True)
class Bones:
    """The bones of a character, parents before their children.

    Attributes
    ----------
    names : list of str
    parents : list of int
        Index of each bone's parent, -1 for none.
    """

    names: list[str]
    parents: list[int]

    @classmethod
    def of(cls, parent_of: Mapping[str, str | None]) -> Bones:
        """Bones from the parent of each bone, in any order."""
        names: list[str] = []

        def add(name: str) -> None:
            if name not in names:
                parent = parent_of[name]
                if parent is not None:
                    add(parent)
                names.append(name)

        for name in parent_of:
            add(name)
        index = {name: i for i, name in enumerate(names)}
        parents = [parent_of[name] for name in names]
        return cls(names, [-1 if parent is None else index[parent] for parent in parents])

    def sides_merged(self) -> tuple[Bones, IntArray]:
        """The bones with left and right as one, and which of them each bone is.

        Two bones are one if their names differ by the side only, at the same depth below the root. A bone of a side
        that has no such counterpart takes one whose name differs by the side and numbers: some exporters number the
        bones of the two sides in opposite order.
        """
        depths: list[int] = []
        for parent in self.parents:
            depths.append(0 if parent < 0 else depths[parent] + 1)
        keys = [(without_side(name), depth) for name, depth in zip(self.names, depths, strict=True)]
        sided = [without_side(name) != name for name in self.names]
        vague = [(re.sub(r"[\d\W_]+", "", key), depth) for key, depth in keys]
        alone = [is_sided and keys.count(key) == 1 for key, is_sided in zip(keys, sided, strict=True)]
        lonely = [key for key, is_alone in zip(vague, alone, strict=True) if is_alone]
        merged: dict[tuple[str, int], int] = {}
        index_of = np.zeros(len(self.names), dtype=np.int64)
        names: list[str] = []
        parents: list[int] = []
        for i, name in enumerate(self.names):
            key = vague[i] if alone[i] and lonely.count(vague[i]) == 2 else keys[i]
            if key not in merged:
                merged[key] = len(names)
                names.append(keys[i][0] if sided[i] and key != (name, depths[i]) else name)
                parents.append(-1 if self.parents[i] < 0 else int(index_of[self.parents[i]]))
            index_of[i] = merged[key]
        return Bones(names, parents), index_of

    def large_enough(self, areas: FloatArray) -> IntArray:
        """(bones,) the bone that each bone counts as, given their areas: small ones are their parents, upward."""
        count_as, areas, least = np.arange(len(self.names)), areas.copy(), SMALLEST_BONE * areas.sum()
        for i in reversed(range(len(self.names))):
            parent = self.parents[i]
            if areas[i] < least and parent >= 0:
                areas[parent] += areas[i]
                count_as[i] = parent
        for i in range(len(self.names)):  # parents come first
            count_as[i] = count_as[count_as[i]]
        return count_as


def without_side(name: str) -> str:
    """The name of a bone without its side, without separators left over at its ends; the name if nothing is left."""
    return SIDE.sub("", name).strip(" ._-") or name if SIDE.search(name) else name


def truth(bones: Bones, bone_of: IntArray, areas: FloatArray) -> tuple[IntArray, Sequence[str]]:
    """The bone that each face counts as, 0, 1, …, and the names of these, given the faces' own bones and areas."""
    merged, index_of = bones.sides_merged()
    of_faces = index_of[bone_of]
    total = np.bincount(of_faces, weights=areas, minlength=len(merged.names)).astype(np.float64)
    count_as = merged.large_enough(total)
    used, numbers = np.unique(count_as[of_faces], return_inverse=True)
    return numbers.ravel().astype(np.int64), [merged.names[i] for i in used]
