"""Which characters are read from frames of an animation, and by which action."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field

import bpy

from ...core.message import Message
from .actions import acting, with_owner
from .characters import Character, armature_of, group, quoted
from .motion import FramesOf, motions
from .touching import joined


@dataclass
class Animated:
    """The characters to read, and what to tell of the choice.

    Attributes
    ----------
    characters
    notes
    """

    characters: list[Character]
    notes: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class Choice:
    """How characters and actions are chosen.

    Attributes
    ----------
    single : bool
        Whether only one of several characters that move is taken: that with the largest moving surface.
    drops : bool
        Whether what does not move is left out, if something does.
    together : bool
        Whether all objects are one character if nothing moves.
    chosen
        Objects of the user's choice: a character with one of them is taken, whether or not it moves most.
    actions : bool
        Whether the action is chosen, if there are several.
    keeps_moving : bool
        See `acting`.
    """

    single: bool = True
    drops: bool = True
    together: bool = False
    chosen: frozenset[bpy.types.Object] = frozenset()
    actions: bool = True
    keeps_moving: bool = False


@contextmanager
def animated(
    context: bpy.types.Context, characters: Sequence[Character], frames_of: FramesOf, choice: Choice
) -> Iterator[Animated]:
    """Choose what moves among characters; the actions that move it are assigned for the time of the block.

    Characters that touch are made one. `frames_of` gives the frames that a character is read at.
    """
    with ExitStack() as stack:
        told: dict[Character, list[Message]] = {}
        if choice.actions:
            for character in _with_own_actions(characters):
                told[character] = stack.enter_context(acting(context, character, frames_of, choice.keeps_moving))
        areas = _moving_areas(context, characters, frames_of)
        moving = [character for character in characters if not choice.drops or areas[character] > 0]
        static = [character for character in characters if moving and character not in moving]
        notes: list[Message] = []
        if static:
            names = quoted(obj.name for character in static for obj in character.objects)
            notes.append(Message("Left out, as they do not move: {names}", names=names))
        if not moving and choice.together:
            taken = group([obj for character in characters for obj in character.objects], together=True)
        else:
            taken, more = joined(context, moving or list(characters))
            notes += more
        if choice.single and moving and len(taken) > 1:
            taken, more = _one_of(taken, areas, choice.chosen)
            notes += more
        members = {member for character in taken for member in character.members}
        for character, texts in told.items():
            if members & set(character.members):
                notes += texts
        yield Animated(taken, [*notes])


def _with_own_actions(characters: Sequence[Character]) -> list[Character]:
    """Characters whose actions are chosen, each by itself; objects without armature and shape keys are one."""
    posable = [character for character in characters if with_owner(character)]
    others = tuple(obj for character in characters if character not in posable for obj in character.objects)
    return [*posable, *([Character(others)] if others else [])]


def _moving_areas(
    context: bpy.types.Context, characters: Sequence[Character], frames_of: FramesOf
) -> dict[Character, float]:
    """Area of each character that moves; one alone is taken to move, since there is nothing to choose."""
    if len(characters) == 1:
        return {characters[0]: 1.0}
    measured = motions(context, characters, frames_of)
    return {character: motion.area for character, motion in zip(characters, measured, strict=True)}


def _one_of(
    characters: Sequence[Character], areas: Mapping[Character, float], chosen: Collection[bpy.types.Object]
) -> tuple[list[Character], list[Message]]:
    """The character of the user's choice, else that with the largest moving surface, given the areas of its parts."""
    for character in characters:
        if any(obj in chosen or armature_of(obj) in chosen for obj in character.objects):
            return [character], []

    def area(character: Character) -> float:
        return sum(size for part, size in areas.items() if set(part.members) <= set(character.members))

    largest = max(characters, key=area)
    note = Message(
        'Several characters move: {names}. "{name}" is taken, which has the largest moving surface; make another one '
        "active (on the command line: --object) to take that",
        names=quoted(character.name for character in characters), name=largest.name,
    )  # fmt: skip
    return [largest], [note]
