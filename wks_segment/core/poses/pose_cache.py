"""A pose in work: what labeling finds out about it is kept, so that other settings are a matter of moments."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from functools import cached_property
from typing import Any, TypeVar

import numpy as np

from ..geometry.creases import coarse_curvature, outward
from ..geometry.heat_flow import Flows
from ..mesh.adjacency import FaceAdjacency
from ..mesh.surface import Surface
from ..mesh.triangle_mesh import FloatArray
from .pose_signature import PoseSignature

T = TypeVar("T")


class Memo:
    """Results by name, each with what it was made from; made again where that is something else."""

    def __init__(self) -> None:
        self._kept: dict[Hashable, tuple[tuple[Any, ...], Any]] = {}

    def get(self, name: Hashable, made_from: tuple[Any, ...], make: Callable[[], T]) -> T:
        """A result; made if there is none, or it is from other objects or numbers."""
        if name not in self._kept or not _same(self._kept[name][0], made_from):
            self._kept[name] = made_from, make()
        result: T = self._kept[name][1]
        return result


def _same(before: tuple[Any, ...], now: tuple[Any, ...]) -> bool:
    """Whether they hold the same objects, or equal numbers."""
    return len(before) == len(now) and all(
        a is b or (isinstance(a, int | float) and isinstance(b, int | float) and a == b)
        for a, b in zip(before, now, strict=True)
    )


class Workpiece:
    """One pose, to be labeled again and again.

    Takes the place of its `PoseSignature` in every method of a model, with the same result. Holds several times its
    memory, so it should go when the work is done. Not for several threads at once.

    Parameters
    ----------
    pose : PoseSignature

    Attributes
    ----------
    flows : Flows
        Of the surface.
    memo : Memo
        What models find out.
    """

    def __init__(self, pose: PoseSignature) -> None:
        self.pose = pose
        self.flows = Flows(pose.surface.mesh)
        self.memo = Memo()

    @property
    def surface(self) -> Surface:
        """Of the pose."""
        return self.pose.surface

    @cached_property
    def neighbors(self) -> FaceAdjacency:
        """Of the original faces, for a surface of area 1."""
        original = self.surface.original
        return FaceAdjacency.of(self.surface.welded_faces, original.vertices / np.sqrt(original.area))

    @cached_property
    def turned(self) -> FloatArray:
        """(m',) 1 for each face of the surface that turns counter-clockwise seen from outside, −1 for others."""
        mesh = self.surface.mesh
        return outward(mesh.faces, mesh.vertices[mesh.faces])

    @cached_property
    def curvature(self) -> FloatArray:
        """(p,) curvature from one of these to the next."""
        return coarse_curvature(self.surface, self.neighbors, self.flows)
