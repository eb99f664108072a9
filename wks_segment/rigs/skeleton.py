"""The bones of a character: names, parents, and which bone is the mirror image of which."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

from ..core.message import Message
from .bone_names import LEFT_SIDE, NO_SIDE, RIGHT_SIDE, BoneName, plain_names


@dataclass(frozen=True)
class Skeleton:
    """Bones, parents before their children.

    Attributes
    ----------
    bones : tuple of str
        Names in the rig.
    parents : tuple of int
        Index of each bone's parent, −1 for none.
    names : tuple of BoneName
        Plain names and sides.
    """

    bones: tuple[str, ...]
    parents: tuple[int, ...]
    names: tuple[BoneName, ...]

    @classmethod
    def of(cls, parent_of: Mapping[str, str | None]) -> Skeleton:
        """Bones from the name of each bone's parent, in any order; ValueError for a circle of parents."""
        order: dict[str, int] = {}
        for bone in parent_of:
            chain: list[str] = []
            above: str | None = bone
            while above is not None and above not in order:
                if above in chain:
                    raise ValueError(Message('the bone "{bone}" is its own parent', bone=above))
                chain.append(above)
                above = parent_of.get(above)
            for each in reversed(chain):
                order[each] = len(order)
        parents = []
        for bone in order:
            parent = parent_of.get(bone)
            parents.append(-1 if parent is None else order[parent])
        return cls(tuple(order), tuple(parents), tuple(plain_names(list(order), parents)))

    def depths(self) -> list[int]:
        """Number of bones above each bone."""
        depths: list[int] = []
        for parent in self.parents:
            depths.append(0 if parent < 0 else depths[parent] + 1)
        return depths

    def sides(self) -> list[int]:
        """Side of each bone: by its own name, else that of the bone above it."""
        sides: list[int] = []
        for named, parent in zip(self.names, self.parents, strict=True):
            sides.append(named.side or (sides[parent] if parent >= 0 else NO_SIDE))
        return sides

    def mirrored(self) -> dict[int, int]:
        """The right bone of each left bone that has one.

        Their words and their depth are the same. Where the numbers differ, since some exporters number both sides in
        opposite order, bones with the same words are pairs in the order of their depth.
        """
        depths = self.depths()
        pairs: dict[int, int] = {}
        for numbers, same_depth in ((True, True), (False, False), (True, False)):
            paired = {*pairs, *pairs.values()}
            at = depths if same_depth else None
            left, right = (self._by_words(side, numbers, at, paired) for side in (LEFT_SIDE, RIGHT_SIDE))
            for words in left.keys() & right.keys():
                sides = [sorted(side[words], key=depths.__getitem__) for side in (left, right)]
                if len(sides[0]) == len(sides[1]):
                    pairs |= dict(zip(*sides, strict=True))
        return pairs

    def _by_words(
        self, side: int, numbers: bool, depths: Sequence[int] | None, without: Collection[int]
    ) -> dict[tuple[object, ...], list[int]]:
        """Bones of a side by their words, with or without numbers, and by their depth if depths are given."""
        found: dict[tuple[object, ...], list[int]] = defaultdict(list)
        for bone, named in enumerate(self.names):
            if named.side == side and bone not in without:
                words = named.words if numbers else tuple(word for word in named.words if not word.isdecimal())
                found[(*words, *(() if depths is None else (depths[bone],)))].append(bone)
        return found
