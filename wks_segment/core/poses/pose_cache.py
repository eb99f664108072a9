"""A described pose with a cache of intermediate results, so that relabeling with other settings is fast."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from enum import Enum, auto
from functools import cached_property
from typing import Any, NamedTuple, TypeVar

import numpy as np

from ..geometry.creases import COARSE, Normals, curvature_across
from ..geometry.heat_flow import Flows
from ..mesh.adjacency import FaceAdjacency
from ..mesh.canonical import spread
from ..mesh.surface import Surface
from ..mesh.triangle_mesh import FloatArray, TriangleMesh
from .pose_signature import PoseSignature

Result = TypeVar("Result")


class Kind(Enum):
    """Kinds of intermediate results that are kept with a pose."""

    POSTERIORS = auto()
    POLYGON_MESH = auto()
    MEAN_POSTERIORS = auto()
    POLYGON_NEIGHBORS = auto()
    REGIONS = auto()
    FIELDS = auto()
    TRAITS = auto()
    SIDE_FIELD = auto()
    BORDER_SHAPE = auto()
    OWN_PARTS = auto()
    BODY_PLACES = auto()


class ResultKey(NamedTuple):
    """Key of an intermediate result.

    Attributes
    ----------
    kind : Kind
    n_poses : int
        Number of poses that the result was computed from together; it is kept with the first one.
    polygons : bool
        Whether the result is about polygons; otherwise it is about triangles or vertices.
    """

    kind: Kind
    n_poses: int = 1
    polygons: bool = False


class ResultCache:
    """Intermediate results by key, each with its inputs; computed again when an input is another one."""

    def __init__(self) -> None:
        self._results: dict[ResultKey, tuple[tuple[Any, ...], Any]] = {}

    def get(self, key: ResultKey, inputs: tuple[Any, ...], compute: Callable[[], Result]) -> Result:
        """The result under a key; computed if there is none, or if it is from other objects or numbers."""
        if key not in self._results or not _same(self._results[key][0], inputs):
            self._results[key] = inputs, compute()
        result: Result = self._results[key][1]
        return result


def _same(before: tuple[Any, ...], now: tuple[Any, ...]) -> bool:
    """Whether both hold the same objects, or equal numbers."""
    return len(before) == len(now) and all(
        a is b or (isinstance(a, int | float) and isinstance(b, int | float) and a == b)
        for a, b in zip(before, now, strict=True)
    )


class Workpiece:
    """A described pose with a cache of intermediate results, to be labeled several times with other settings.

    Every method of a model accepts a `Workpiece` instead of a `PoseSignature` and gives the same result. It takes
    several times the memory, so drop it when the labels are final. Not for use by several threads at once.

        pose = Workpiece(model.describe(mesh))
        coarse, fine = (model.with_segments(n).segment_faces(pose) for n in (4, 8))

    Parameters
    ----------
    pose : PoseSignature
        The described pose.

    Attributes
    ----------
    flows : Flows
        Heat flows on the surface.
    normals : Normals
        Outward normals of the surface.
    results : ResultCache
        Intermediate results of models on this pose.

    Examples
    --------
    >>> from examples.tube import tube
    >>> from wks_segment.core import PoseSegmentation, Workpiece
    >>> model = PoseSegmentation(n_segments=2, n_eigenpairs=40).fit([tube(0.2), tube(0.8), tube(1.4)])
    >>> work = Workpiece(model.describe_all([tube(1.1)])[0])
    >>> bool((model.segment_faces(work) == model.segment_faces(tube(1.1))).all())  # the second call is quick
    True
    """

    def __init__(self, pose: PoseSignature) -> None:
        self.pose = pose
        self.flows = Flows(pose.surface.mesh)
        self.normals = Normals(pose.surface, self.flows)
        self.results = ResultCache()

    @property
    def surface(self) -> Surface:
        """The welded and refined surface, with n' vertices."""
        return self.pose.surface

    @property
    def signature(self) -> FloatArray:
        """(n', n_energies) signature at the vertices of the surface."""
        return self.pose.signature

    @cached_property
    def neighbors(self) -> FaceAdjacency:
        """Neighbors among the m original faces, with border lengths for a surface of area 1."""
        original = self.surface.original
        return FaceAdjacency.of(self.surface.welded_faces, original.vertices / np.sqrt(original.area))

    @cached_property
    def curvature(self) -> FloatArray:
        """(p,) curvature across the border of each pair of `neighbors`."""
        return curvature_across(self.surface, self.normals.over(COARSE), self.neighbors)


AnyPose = TriangleMesh | PoseSignature | Workpiece
"""A pose as methods of a model accept it: the later in this list, the less is left to compute."""


def smooth_means(
    poses: Sequence[Workpiece], at_vertices: Callable[[Workpiece], FloatArray], length: float
) -> Callable[[Workpiece], FloatArray]:
    """Function that gives values at the vertices of one of the poses of a mesh, smoothed within about a length.

    Poses whose surfaces have the same triangles share the mean of their values: it is smoothed once, where limbs are
    stretched out most, since smoothing does about the same in every pose. Otherwise, as after refinement, each pose has
    its own values.

    Parameters
    ----------
    poses
    at_vertices
        Gives (n', k) values at the vertices of a pose.
    length : float
        In units of the square root of the area; 0: no smoothing.
    """

    def smooth(pose: Workpiece, values: FloatArray) -> FloatArray:
        return pose.flows.over(length).smooth(values) if length > 0 else values

    triangles = poses[0].surface.mesh.faces
    if len(poses) == 1 or any(not np.array_equal(pose.surface.mesh.faces, triangles) for pose in poses):
        return lambda pose: smooth(pose, at_vertices(pose))
    total = sum(at_vertices(pose) for pose in poses)
    stretched = max(poses, key=lambda pose: spread(pose.surface.original))
    common = smooth(stretched, np.asarray(total / len(poses)))
    return lambda pose: common
