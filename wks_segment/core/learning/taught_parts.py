"""Parts that a user teaches: which face of which learned mesh is which part, and which parts are left and right.

Signatures cannot tell a left hand from a right one. So two taught parts that are alike are one *group* of components of
the mixture, whose faces are told apart by their side; every other taught part is a group of its own.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.spatial import cKDTree

from ..files.checked_json import DamagedError
from ..mesh.triangle_mesh import FloatArray, IntArray
from ..message import Message
from .merge_tree import TWO_PARTS, MergeTree
from .parameters import NSegments

NOT_SAID = -1
"""Label of a face whose part is not said."""
LEAST_FACES = 3
"""Fewest faces of a part on all learned meshes together: with fewer, a slip of the brush would be a part."""
MOST_TAUGHT = 500
"""Most taught parts: segments made by hand have the numbers from here in Blender."""
MOST_COMPARED = 400
"""Most samples of a part that are compared with those of another one."""
ALIKE = 0.7
"""Two parts are alike if the samples of each are so near to those of the other, in units of the spread inside the part
(median). On five scans of people and on MakeHuman's body, mirrored parts have 0.02 to 0.63 (once 0.88), neighbors and
any others 0.89 and more."""
MUCH_NEARER = 0.6
"""Two parts are alike only if they are nearer to each other than to any third part by this factor: limbs of a figure
can all be somewhat alike. It is up to 0.55 for mirrored parts of four of five scans."""
LEAST_COMMON = 0.5
"""Share of the borders of two mirrored parts that is with the same parts, from which they are mirrored; at best 1."""

Unlabeled = Literal["learn", "ignore"]


@dataclass(frozen=True)
class TaughtLabels:
    """What `fit` is taught.

    Attributes
    ----------
    of_faces : list of (m,) int arrays
        Result of `checked_labels`.
    unlabeled : "learn" or "ignore"
        What becomes of faces of which nothing is said.
    apart
        Pairs of parts that are no left and right, whatever their signatures say.
    """

    of_faces: list[IntArray]
    unlabeled: Unlabeled
    apart: frozenset[tuple[int, int]] = frozenset()


class UnlikePartsError(ValueError):
    """Two taught parts are alike and not left and right; `parts` are their numbers."""

    def __init__(self, first: int, second: int) -> None:
        super().__init__(
            Message(
                "parts {first} and {second} cannot be told apart: they have the same shape, and are not left and "
                "right of each other. Teach them as one part",
                first=first,
                second=second,
            )
        )
        self.parts = first, second


@dataclass(frozen=True)
class TaughtParts:
    """Which groups of components the taught parts are.

    Attributes
    ----------
    left : (g,) int array
        Taught part of each group on the left, and in the middle.
    right : (g,) int array
        The same on the right: another part for parts that were taught as left and right.
    of_bodies : bool
        Whether they were taught on several meshes: from body to body the same part differs, but keeps about its area,
        so that borders are smoothed more and areas count.
    """

    left: IntArray
    right: IntArray
    of_bodies: bool

    @classmethod
    def of(cls, n_parts: int, pairs: Sequence[tuple[int, int]], of_bodies: bool) -> TaughtParts:
        """Groups in the order of their lowest parts, given pairs of left and right parts, the lower number first."""
        of_pairs = {part for pair in pairs for part in pair}
        both = sorted([*pairs, *((part, part) for part in range(n_parts) if part not in of_pairs)])
        left, right = np.array(both, dtype=np.int64).T
        return cls(left, right, of_bodies)

    @property
    def n_groups(self) -> int:
        """Number of groups that are taught parts."""
        return len(self.left)

    @property
    def n_parts(self) -> int:
        """Number of taught parts."""
        return int(max(self.left.max(), self.right.max())) + 1

    @property
    def sided(self) -> IntArray:
        """Groups that are two parts, left and right."""
        return np.flatnonzero(self.left != self.right)

    @property
    def group_of_part(self) -> IntArray:
        """(n_parts,) group of each part."""
        groups = np.empty(self.n_parts, dtype=np.int64)
        groups[self.left] = groups[self.right] = np.arange(self.n_groups)
        return groups

    @property
    def side_of_part(self) -> IntArray:
        """(n_parts,) 1 for a left part, −1 for a right one, 0 for a part that has no mirrored one."""
        sides = np.zeros(self.n_parts, dtype=np.int64)
        sides[self.left[self.sided]], sides[self.right[self.sided]] = 1, -1
        return sides

    def arrays(self) -> dict[str, IntArray]:
        """Arrays for a model file; `of_arrays` reads them."""
        return {f"taught_{name}": np.array(value, dtype=np.int64) for name, value in vars(self).items()}

    @classmethod
    def of_arrays(cls, arrays: Mapping[str, FloatArray]) -> TaughtParts | None:
        """The taught parts in arrays of a model file, if any; DamagedError if a part is not there once."""
        if "taught_left" not in arrays:
            return None
        left, right = (arrays[f"taught_{name}"].astype(np.int64) for name in ("left", "right"))
        parts = np.append(left, right[left != right])
        if len(left) > int(arrays["n_kinds"]) or not np.array_equal(np.sort(parts), np.arange(len(parts))):
            raise DamagedError("taught_left and taught_right do not have each part once")
        return cls(left, right, bool(arrays["taught_of_bodies"]))

    def number_of(self, n_segments: NSegments, tree: MergeTree) -> int:
        """Number of groups for a parameter `n_segments`: the taught ones, and at least one of what was not taught.

        All parts together are `n_segments`, if there are not more taught ones.
        """
        if tree.n_kinds == self.n_groups:
            return self.n_groups
        if n_segments == "auto":
            wanted = 1 + int(np.count_nonzero(tree.likeness[self.n_groups + 1 : tree.n_kinds] < TWO_PARTS))
        else:
            wanted = max(1, n_segments - self.n_parts)
        return min(self.n_groups + wanted, len(tree.certainties))

    def has_pair(self, first: int, second: int) -> bool:
        """Whether two parts are left and right of one group."""
        return any({first, second} == {left, right} for left, right in zip(self.left, self.right, strict=True))

    def parts(self, groups: IntArray, sides: IntArray) -> IntArray:
        """Part of each place, given its group (−1 stays) and side; groups that were not taught are numbered after."""
        taught = (groups >= 0) & (groups < self.n_groups)
        of_group = np.where(sides[taught] < 0, self.right[groups[taught]], self.left[groups[taught]])
        parts = np.where(groups < 0, groups, groups - self.n_groups + self.n_parts)
        parts[taught] = of_group
        return parts

    def of_parts(self, posteriors: FloatArray, side: FloatArray) -> FloatArray:
        """(n, parts) posteriors of parts, given those of groups and (n,) the side of each place: 1 left, −1 right."""
        others = posteriors[:, self.n_groups :]
        result = np.zeros((len(posteriors), self.n_parts + others.shape[1]), dtype=posteriors.dtype)
        result[:, self.left] = posteriors[:, : self.n_groups]
        sided, right = self.sided, side < 0
        result[np.ix_(~right, self.right[sided])] = 0
        result[np.ix_(right, self.right[sided])] = posteriors[np.ix_(right, sided)]
        result[np.ix_(right, self.left[sided])] = 0
        result[:, self.n_parts :] = others
        return result


def checked_labels(labels: Sequence[IntArray | None], n_faces: Sequence[int]) -> list[IntArray]:
    """For each mesh the taught part of each face, −1 where it is not said.

    Parameters
    ----------
    labels
        For each mesh (m,) whole numbers, or None if nothing is said.
    n_faces
        Number of faces of each mesh.

    Raises
    ------
    ValueError
        If the lengths do not fit, a number is no whole number or below −1, a number up to the highest is missing, or a
        part has too few faces.
    """
    if len(labels) != len(n_faces):
        raise ValueError(
            Message("there are {meshes} meshes, but labels for {given}", meshes=len(n_faces), given=len(labels))
        )
    checked = []
    for i, (of_mesh, count) in enumerate(zip(labels, n_faces, strict=True)):
        given = np.full(count, NOT_SAID) if of_mesh is None else np.asarray(of_mesh)
        if given.shape != (count,):
            raise ValueError(
                Message(
                    "mesh {number} has {faces:,} faces, but labels of shape {given}",
                    number=i + 1, faces=count, given=given.shape,
                )
            )  # fmt: skip
        whole = np.issubdtype(given.dtype, np.integer) or (
            np.issubdtype(given.dtype, np.floating) and bool((np.trunc(given) == given).all())
        )
        if not whole or (count and (given.min() < NOT_SAID or given.max() >= MOST_TAUGHT)):
            raise ValueError(
                Message(
                    "labels of mesh {number} must be whole numbers from 0 to {most}, or -1 where no part is said",
                    number=i + 1, most=MOST_TAUGHT - 1,
                )
            )  # fmt: skip
        checked.append(given.astype(np.int64))
    _check_counts(checked)
    return checked


def _check_counts(labels: Sequence[IntArray]) -> None:
    """ValueError if no part is said, a number is missing, or a part has too few faces."""
    said = np.concatenate([of_mesh[of_mesh >= 0] for of_mesh in labels])
    if not len(said):
        raise ValueError("labels say no part of any face: give at least one face a number from 0")
    counts = np.bincount(said)
    missing = np.flatnonzero(counts == 0)
    if len(missing):
        raise ValueError(
            Message(
                "labels have a part {highest}, but no face has part {missing}: number the parts 0, 1, 2 … without gaps",
                highest=len(counts) - 1, missing=int(missing[0]),
            )
        )  # fmt: skip
    small = np.flatnonzero(counts < LEAST_FACES)
    if len(small):
        raise ValueError(
            Message(
                "part {part} has {count:,} faces in all labels together, but needs at least {least}: mark more of it",
                part=int(small[0]), count=int(counts[small[0]]), least=LEAST_FACES,
            )
        )  # fmt: skip


def alike_parts(
    places: FloatArray, part: IntArray, n_parts: int, apart: Collection[tuple[int, int]] = ()
) -> list[tuple[int, int]]:
    """Pairs of parts that have the same signatures: each part is in one pair at most.

    Parameters
    ----------
    places : (n, q) array
        Samples along axes of about equal weight.
    part : (n,) int array
        Part of each sample, −1 for none.
    n_parts : int
    apart
        Pairs that are none, the lower number first.

    Returns
    -------
    List of pairs, the lower number first.
    """
    samples = []
    for i in range(n_parts):
        members = np.flatnonzero(part == i)
        samples.append(places[members[np.unique(np.linspace(0, len(members) - 1, MOST_COMPARED).astype(int))]])
    trees = [cKDTree(one) for one in samples]
    spread = [float(np.sqrt(one.var(axis=0).sum())) + np.finfo(float).tiny for one in samples]
    unlike = np.full((n_parts, n_parts), np.inf)
    for i in range(n_parts):
        for j in range(n_parts):
            if i != j:
                unlike[i, j] = float(np.median(trees[j].query(samples[i])[0])) / spread[i]
    unlike = np.maximum(unlike, unlike.T)
    for i, j in apart:
        unlike[i, j] = unlike[j, i] = np.inf
    pairs = []
    for i in range(n_parts):
        for j in range(i + 1, n_parts):
            others = np.delete(unlike[[i, j]], [i, j], axis=1)
            if unlike[i, j] < min(ALIKE, MUCH_NEARER * others.min(initial=np.inf)):
                pairs.append((i, j))
    return pairs


def with_like_neighbors(pairs: Sequence[tuple[int, int]], touching: FloatArray) -> list[tuple[int, int]]:
    """The pairs whose parts touch the same others, left and right counting as one: a head and a tail do not.

    Parameters
    ----------
    pairs
        Result of `alike_parts`.
    touching : (parts, parts) array
        Length of the borders between parts on all meshes.
    """
    kept: list[tuple[int, int]] = []
    one_of_pair = np.arange(len(touching))
    for first, second in pairs:
        one_of_pair[second] = first
    own = np.eye(len(touching))[one_of_pair]
    shares = touching @ own
    for first, second in pairs:
        profiles = np.delete(shares[[first, second]], first, axis=1)
        total = profiles.sum(axis=1)
        # Strokes touch nothing, and say nothing about it.
        common = np.minimum(*(profiles / np.where(total > 0, total, 1.0)[:, None])).sum()
        if not total.all() or common > LEAST_COMMON:
            kept.append((first, second))
    return kept
