"""Characters of several objects that are not parented to each other, recognized by where they lie."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import bpy
import numpy as np
from mathutils.bvhtree import BVHTree

from ...core.mesh.triangle_mesh import FloatArray, IntArray
from ...core.message import Message
from .characters import Character, armature_of, quoted
from .motion import evaluated_surface
from .surfaces import has_corners_of

TOUCH = 0.02
"""Objects touch if they cross, or are nearer than this share of the size of the smaller one: modelers leave gaps."""
NEAR_VERTICES = 500
"""Most vertices of an object that are looked up on the other one."""
SAME_PLACE, SAME_PLACE_OF_COPIES = 0.8, 0.3
"""Share of their boxes in common above which two objects are the same thing twice, as poses or levels of detail that
lie on each other: for two objects, and for two with the same faces. Parts of a creature share less, eyes nothing."""
FLAT = 0.02
"""An object is a ground if its height is below this share of its length and width, and it is larger than the other."""


@dataclass
class _Body:
    """A character with what tells whether it touches others."""

    character: Character
    points: FloatArray
    triangles: IntArray
    collections: set[bpy.types.Collection]
    armatures: set[bpy.types.Object]
    low: FloatArray = field(init=False)
    high: FloatArray = field(init=False)

    def __post_init__(self) -> None:
        self.low, self.high = self.points.min(axis=0), self.points.max(axis=0)

    @cached_property
    def tree(self) -> BVHTree:
        """Finds what is near; made for bodies whose boxes are near others only."""
        return BVHTree.FromPolygons(self.points.tolist(), self.triangles.tolist())

    @property
    def size(self) -> float:
        return float((self.high - self.low).max())


def joined(context: bpy.types.Context, characters: Sequence[Character]) -> tuple[list[Character], list[Message]]:
    """The characters, with those made one that touch each other in one collection; and notes on what was made one.

    Characters on different armatures stay apart, and so do objects that lie on each other as poses do.
    """
    depsgraph = context.evaluated_depsgraph_get()
    bodies = [body for character in characters if (body := _body(character, depsgraph)) is not None]
    groups: list[list[_Body]] = [[body] for body in bodies]
    for i, one in enumerate(bodies):
        for other in bodies[:i]:
            first, second = (next(group for group in groups if body in group) for body in (one, other))
            if first is not second and _may_join(first, second) and _touch(one, other):
                groups.remove(second)
                first += second
    result: list[Character] = []
    notes: list[Message] = []
    for character in characters:
        of_groups = ([body.character for body in group] for group in groups)
        parts = next((parts for parts in of_groups if character in parts), [])
        if len(parts) < 2:
            result.append(character)
        elif character == next(other for other in characters if other in parts):
            objects = sorted((obj for part in parts for obj in part.objects), key=lambda obj: obj.name)
            result.append(Character(objects))
            names = quoted(obj.name for obj in objects)
            notes.append(Message("Taken as one character, as they touch: {names}", names=names))
    return result, notes


def _body(character: Character, depsgraph: bpy.types.Depsgraph) -> _Body | None:
    """What tells whether a character touches others; None if it has no surface."""
    points, triangles = evaluated_surface(character, depsgraph)
    if not len(triangles) or not np.isfinite(points).all():
        return None
    objects = character.objects
    return _Body(
        character,
        points,
        triangles,
        {collection for obj in objects for collection in obj.users_collection},
        {armature for armature in map(armature_of, objects) if armature is not None},
    )


def _may_join(one: list[_Body], other: list[_Body]) -> bool:
    """Whether two groups of bodies can be one character: in one collection, on one armature at most, each once."""
    shared = set.intersection(*(body.collections for body in (*one, *other)))
    armatures = set.union(*(body.armatures for body in (*one, *other)))
    return bool(shared) and len(armatures) <= 1 and not any(_is_twice(a, b) for a in one for b in other)


def _is_twice(a: _Body, b: _Body) -> bool:
    """Whether two bodies are the same thing twice: they share a mesh, as poses may, or lie at one place."""
    if set(a.character.meshes) & set(b.character.meshes):
        return True
    common = np.prod(np.maximum(np.minimum(a.high, b.high) - np.maximum(a.low, b.low), 0))
    both = np.prod(a.high - a.low) + np.prod(b.high - b.low) - common
    ours, theirs = a.character.objects, b.character.objects
    alike = len(ours) == len(theirs) and all(
        has_corners_of(x.data, y.data) for x, y in zip(ours, theirs, strict=True)
    )  # fmt: skip
    return bool(common > (SAME_PLACE_OF_COPIES if alike else SAME_PLACE) * both)


def _touch(a: _Body, b: _Body) -> bool:
    """Whether two bodies cross or nearly touch, and neither is the ground of the other."""
    near = TOUCH * min(a.size, b.size)
    if np.any(a.low > b.high + near) or np.any(b.low > a.high + near) or _is_ground(a, b) or _is_ground(b, a):
        return False
    if a.tree.overlap(b.tree):
        return True
    pairs = ((a.points, b.tree), (b.points, a.tree))
    return any(
        tree.find_nearest(point, near)[0] is not None
        for points, tree in pairs
        for point in points[:: max(1, len(points) // NEAR_VERTICES)].tolist()
    )


def _is_ground(a: _Body, b: _Body) -> bool:
    length, width, height = a.high - a.low
    other_length, other_width, _ = b.high - b.low
    return bool(height <= FLAT * min(length, width) and length > other_length and width > other_width)
