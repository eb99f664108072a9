"""How much characters move in frames of the animation, measured on their surfaces as they are seen."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import bpy
import numpy as np

from ...core.mesh.triangle_mesh import FloatArray, IntArray
from .attributes import read_floats, read_ints
from .characters import Character
from .poses import SAME_SURFACE, evenly

FRAMES = 5
"""Most frames that a character is measured in: of a gait they are enough to see it move."""
FramesOf = Callable[[Character], list[int]]
"""Gives the frames that a character's poses are read at."""


@dataclass(frozen=True)
class Motion:
    """Motion of a character over some frames.

    Attributes
    ----------
    area : float
        Area of the faces that move, in the first frame.
    bending : float
        Root mean square of how far vertices move beside turns and shifts of the whole, in units of its size.
    """

    area: float
    bending: float

    @property
    def is_bent(self) -> bool:
        """Whether the frames show different poses, not just one at different places."""
        return self.bending > SAME_SURFACE


def motions(context: bpy.types.Context, characters: Sequence[Character], frames_of: FramesOf) -> list[Motion]:
    """The motion of each character over its frames; the scene is at its own frame again afterward."""
    scene = context.scene
    before, subframe = scene.frame_current, scene.frame_subframe
    of_each = [_some(frames_of(character)) for character in characters]
    places: list[list[FloatArray]] = [[] for _ in characters]
    triangles: dict[int, IntArray] = {}
    try:
        for frame in sorted(set().union(*of_each)):
            scene.frame_set(frame)
            depsgraph = context.evaluated_depsgraph_get()
            for i, character in enumerate(characters):
                if frame in of_each[i]:
                    vertices, faces = evaluated_surface(character, depsgraph)
                    places[i].append(vertices)
                    triangles.setdefault(i, faces)
    finally:
        scene.frame_set(before, subframe=subframe)
    return [_motion(places[i], triangles[i]) for i in range(len(characters))]


def _some(frames: list[int]) -> list[int]:
    return [frames[i] for i in evenly(0, len(frames) - 1, FRAMES)]


def evaluated_surface(character: Character, depsgraph: bpy.types.Depsgraph) -> tuple[FloatArray, IntArray]:
    """Vertices in world space and triangles of a character as it is seen."""
    vertices: list[FloatArray] = [np.zeros((0, 3))]
    triangles: list[IntArray] = [np.zeros((0, 3), dtype=np.int64)]
    for obj in character.objects:
        evaluated = obj.evaluated_get(depsgraph)
        mesh = evaluated.to_mesh()
        mesh.calc_loop_triangles()
        world = np.array(evaluated.matrix_world, dtype=np.float64)
        triangles.append(read_ints(mesh.loop_triangles, "vertices", 3) + sum(map(len, vertices)))
        vertices.append(read_floats(mesh.vertices, "co", 3) @ world[:3, :3].T + world[:3, 3])
        evaluated.to_mesh_clear()
    return np.concatenate(vertices), np.concatenate(triangles)


def _motion(places: Sequence[FloatArray], triangles: IntArray) -> Motion:
    first = places[0]
    a, b, c = (first[triangles[:, i]] for i in range(3))
    areas = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    if any(other.shape != first.shape for other in places):  # other faces in another frame
        return Motion(float(areas.sum()), 1.0)
    size = float(np.ptp(first, axis=0).max()) if len(first) else 0.0
    if not size > 0 or not all(np.isfinite(other).all() for other in places):  # refused when the poses are read
        return Motion(0.0, 0.0)
    moved = np.zeros(len(first), dtype=bool)
    for other in places[1:]:
        moved |= np.abs(other - first).max(axis=1) > SAME_SURFACE * size
    bent = [_beside_turn(first, other) for other in places]
    return Motion(float(areas[moved[triangles].any(axis=1)].sum()), float(np.sqrt(np.mean(bent))) / size)


def _beside_turn(first: FloatArray, other: FloatArray) -> float:
    """Mean square distance between two sets of points after the best turn and shift (Kabsch's algorithm)."""
    a, b = first - first.mean(axis=0), other - other.mean(axis=0)
    left, _, right = np.linalg.svd(b.T @ a)
    flip = np.diag([1.0, 1.0, np.sign(np.linalg.det(left @ right))])
    return float(((b @ (left @ flip @ right) - a) ** 2).sum(axis=1).mean())
