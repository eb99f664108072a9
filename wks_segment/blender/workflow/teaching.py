"""Reads what *Learn from My Parts* learns: the poses of all selected characters, and their parts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import bpy
import numpy as np

from ...core.mesh.triangle_mesh import IntArray
from ...core.message import Message, message_of
from ...core.user_labels import LEAST_FACES, NOT_SAID, Unlabeled
from ...rigs import parts_of_faces, split_side
from ..errors import UserError
from ..outputs.taught_parts import BONES, TaughtParts, taught_parts
from ..props.settings import WKSSegmentSettings
from ..scene import poses as reader
from ..scene.bone_weights import bone_tree_of
from ..scene.characters import Character, group, quoted
from ..scene.pose_sources import read_training_poses
from ..scene.poses import Pose
from ..scene.simulations import check_simulations
from . import bone_list
from .report import Report


@dataclass(frozen=True)
class Lesson:
    """What a model is taught.

    Attributes
    ----------
    names : list of str
        Names of the parts.
    labels : list of (m,) int arrays
        For each pose, the part of each triangle; −1 where none is said.
    unlabeled : "learn" or "ignore"
        What becomes of faces without a part.
    from_bones : bool
        Whether the parts are those of a rig, not an artist's.
    """

    names: list[str]
    labels: list[IntArray]
    unlabeled: Unlabeled
    from_bones: bool = False

    def named(self, error: ValueError) -> ValueError:
        """An error of the core with the name of the part that it is about, instead of its number."""
        message = message_of(error)
        if not isinstance(message, Message) or not isinstance(message.values.get("part"), int):
            return error
        name = self.names[int(str(message.values["part"]))]
        return ValueError(Message(message.template, **{**message.values, "part": f'"{name}"'}))

    def joined(self, first: int, second: int) -> tuple[Lesson, Message]:
        """The lesson with two parts of the same shape as one, and what to tell about it.

        Parts with the same name but for the side get that name. Of two other parts from bones the larger one gives the
        name, since an artist cannot change what a rig says.

        Raises
        ------
        UserError
            If an artist has made both; it names them.
        """
        one, other = self.names[first], self.names[second]
        (name, side), (other_name, other_side) = split_side(one), split_side(other)
        if name == other_name and {side, other_side} == {1, 2}:
            told = Message(
                '"{left}" and "{right}" are no mirror images of each other, and are learned as one part',
                left=one, right=other,
            )  # fmt: skip
        elif self.from_bones:
            faces = [sum(int((labels == part).sum()) for labels in self.labels) for part in (first, second)]
            name = one if faces[0] >= faces[1] else other
            told = Message(
                '"{one}" and "{other}" have the same shape, and are learned as one part', one=one, other=other
            )
        else:
            raise UserError(
                '"{first}" and "{second}" have the same shape, and are not left and right of each other: teach them as '
                "one part",
                first=one, second=other,
            )  # fmt: skip
        kept, dropped = sorted((first, second))
        names = [each for part, each in enumerate(self.names) if part != dropped]
        names[kept] = name
        # As an index, the number of what is not said is the last one.
        number = np.array([*range(dropped), kept, *range(dropped, len(names)), NOT_SAID])
        return replace(self, names=names, labels=[number[labels] for labels in self.labels]), told


def read_lesson(settings: WKSSegmentSettings, poses: Sequence[Pose], told: Report) -> Lesson:
    """The parts of the characters of poses, read from the source that the settings name.

    Raises
    ------
    UserError
        If there are none.
    """
    characters = list(dict.fromkeys(pose.character for pose in poses))
    if settings.parts_from == BONES:
        parts = _parts_from_bones(settings, characters)
    else:
        parts = taught_parts(
            characters, settings.parts_from, settings.taught_sides, settings.all_face_sets, told.choices
        )
    names, labels = parts.of_poses(poses)
    if not names:
        raise UserError("No pose shows a part: are the faces of all parts masked or removed by modifiers?")
    unseen = [name for name in parts.names if name not in names]
    if unseen:
        told.warn(
            Message(
                "Not learned, since the poses show fewer than {least:,} faces of it: {names}",
                least=LEAST_FACES,
                names=quoted(unseen),
            )
        )
    if settings.unlabeled == "ignore" and len(names) < 2:
        raise UserError(
            'There is only one part, "{name}": add another one, or set Other Faces to Find Segments', name=names[0]
        )
    return Lesson(names, labels, settings.unlabeled, settings.parts_from == BONES)


def read_lesson_poses(context: bpy.types.Context, objects: Sequence[bpy.types.Object], told: Report) -> list[Pose]:
    """Poses of all characters of some objects, each in the poses that the settings name, without repetitions.

    Raises
    ------
    UserError
        If they cannot be used.
    """
    settings = context.scene.wks_segment
    if settings.source == "OBJECTS":
        characters = group(objects, together=settings.one_character)
        check_simulations(context.scene, characters, over_time=False)
        return reader.read_objects(context, characters)
    found: list[Pose] = []
    for character in group(objects):
        own: list[Pose] = []
        for pose in read_training_poses(context, settings, told, character.objects):
            if not any(pose.is_like(other) for other in own):
                own.append(pose)
        found += own
    return found


def _parts_from_bones(settings: WKSSegmentSettings, characters: Sequence[Character]) -> TaughtParts:
    """Parts of characters by the bones that move them."""
    trees = [bone_tree_of(character) for character in characters]
    own, names = bone_list.own_rows(trees, settings)
    found = parts_of_faces(trees, own, settings.taught_sides, names)
    labels = dict(zip(characters, found.labels, strict=True))
    return TaughtParts([part.full_name for part in found.parts], labels)
