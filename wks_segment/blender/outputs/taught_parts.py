"""The parts that a model is taught: what an artist made of the faces of some characters, by name."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import bpy
import numpy as np

from ...core.mesh.triangle_mesh import IntArray
from ...core.message import Message
from ...core.user_labels import LEAST_FACES, LONGEST_NAME
from ...rigs import split_side
from ..errors import UserError
from ..parts import part_ids
from ..props.label_set import style_of
from ..scene.characters import Character, quoted
from ..scene.poses import Pose
from .import_labels import FACE_SETS, membership_of
from .origin import origin_of
from .part_attributes import labels_on

SEGMENTS, BONES = "SEGMENTS", "BONES"
"""Further sources of parts, besides those that *Segments From* reads."""
UNPAINTED_FACE_SET = 1
"""The face set that Blender gives to faces that nobody painted."""


NO_TAUGHT_PART = (
    "There is no part: paint a face set beside the one that all faces have, fill a vertex group or assign a material, "
    "or take the parts from something else"
)


@dataclass(frozen=True)
class TaughtParts:
    """Named parts of some characters.

    Attributes
    ----------
    names : list of str
        Names of the parts, all different; a part on one side ends in .L or .R.
    labels
        For each character the (p,) part of each of its polygons, −1 where none is said.
    """

    names: list[str]
    labels: Mapping[Character, IntArray]

    def of_poses(self, poses: Sequence[Pose]) -> tuple[list[str], list[IntArray]]:
        """Names of the parts that poses show, and for each pose the (m,) number of each triangle, without gaps.

        A part of fewer than `LEAST_FACES` triangles is none: so small a one is a slip of the brush.
        """
        found = []
        for pose in poses:
            parts = self.labels[pose.character][pose.polygon_of]
            found.append(np.where(pose.polygon_of >= 0, parts, -1))
        shown, counts = np.unique(np.concatenate(found), return_counts=True)
        shown = shown[(shown >= 0) & (counts >= LEAST_FACES)]
        renumbered = np.full(len(self.names) + 1, -1)
        renumbered[shown] = np.arange(len(shown))
        return [self.names[part] for part in shown], [renumbered[parts] for parts in found]


def taught_parts(
    characters: Sequence[Character], source: str, sides: bool, all_face_sets: bool, told: list[str]
) -> TaughtParts:
    """What the artist made of characters, from segments, face sets, materials or vertex groups.

    The same name is the same part on all of them.

    Parameters
    ----------
    characters
    source : str
        `SEGMENTS`, or one of `import_labels.LABEL_SOURCES`.
    sides : bool
        Whether names that differ by their side only are two parts.
    all_face_sets : bool
        Whether the face set that Blender gives to unpainted faces is a part, too.
    told
        Gets notes on what was left out.

    Raises
    ------
    UserError
        If no character has anything of that kind.
    """
    labels: dict[Character, IntArray] = {}
    numbers: dict[str, int] = {}
    refused: list[UserError] = []
    missing: list[str] = []
    for character in dict.fromkeys(characters):
        of_objects = []
        for obj in character.objects:
            try:
                names, index = _named(obj, source, all_face_sets)
            except UserError as error:
                refused.append(error)
                missing.append(obj.name)
                of_objects.append(np.full(len(obj.data.polygons), -1))
                continue
            used = np.unique(index[index >= 0])
            number = np.full(len(names) + 1, -1)
            for i in used.tolist():
                name = names[i]
                if name is not None:
                    number[i] = numbers.setdefault(_shortened(name, sides), len(numbers))
            of_objects.append(number[index])
        labels[character] = np.concatenate(of_objects)
    if not numbers:
        raise refused[0] if refused else UserError(NO_TAUGHT_PART)
    if missing:
        told.append(Message("{names} has no parts and is left to the model", names=quoted(missing)))
    return TaughtParts(list(numbers), labels)


def _named(obj: bpy.types.Object, source: str, all_face_sets: bool) -> tuple[list[str | None], IntArray]:
    """Names of what the polygons of an object are in, None for no part, and the (p,) index of each polygon."""
    style = style_of(origin_of(obj.data).labels)
    if source == SEGMENTS:
        parts = labels_on(obj.data)
        if parts is None:
            raise UserError('"{name}" has no segments: make some first, or take the parts from bones', name=obj.name)
        present, index = np.unique(parts, return_inverse=True)
        return [style.name_of(part) if part >= 0 else None for part in present.tolist()], index.ravel()
    found = membership_of(obj, source)
    names: list[str | None] = []
    for key in found.keys:
        part = found.ours.get(key) if key is not None else None
        if part is not None:
            names.append(style.name_of(part))
        elif key is None:
            names.append(None)
        elif source == FACE_SETS:
            unpainted = isinstance(key, int) and key <= UNPAINTED_FACE_SET
            names.append(None if unpainted and not all_face_sets else f"Face Set {key}")
        else:
            names.append(key.name if isinstance(key, bpy.types.Material) else str(key))
    return names, found.index


def _shortened(name: str, sides: bool) -> str:
    """A name that a part may have, with the suffix of its side, or without its side."""
    text, side = split_side(name)
    suffix = part_ids.SIDE_SUFFIXES[side] if sides else ""
    text = "".join(letter for letter in text if letter.isprintable()).strip() or "Part"
    return text[: LONGEST_NAME - len(suffix)].rstrip() + suffix
