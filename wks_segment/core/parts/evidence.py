"""Everything that is known of the faces of one mesh from all of its poses together.

Labels of one mesh are the mesh's own, once for all its poses: creases, thickness and signature are averaged over the
poses before anything is decided, and motion is what differs between them.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..geometry.creases import BorderShape, border_shape
from ..mesh.adjacency import FaceAdjacency
from ..mesh.canonical import order_of_faces, spread
from ..mesh.mirror import mirrored_faces
from ..mesh.surface import Surface
from ..mesh.triangle_mesh import FloatArray, IntArray, TriangleMesh
from ..message import Message, message_of
from ..poses.pose_cache import Kind, ResultKey, Workpiece
from ..poses.signature_cache import Cache, content_key
from ..progress import Progress

SHAPE_VERSION = 1
"""To be raised whenever the same pose has other creases or thickness than before."""
TIE_CURVATURE = -6.0
"""Curvature where islands are tied: they meet like parts in a crease, not like the halves of a flat sheet."""
MOST_SHAPES = 3
"""Most poses whose creases and thickness are measured; more hardly change the means."""


@dataclass(frozen=True)
class Evidence:
    """What is known of the m faces of a mesh, mean over its poses.

    Attributes
    ----------
    poses
        Of the mesh.
    areas : (m,) array
        Shares of the whole area.
    centers : (m, 3) array
        At rest if possible, otherwise in the pose whose limbs are stretched out most, for a surface of area 1.
    neighbors : FaceAdjacency
        Faces that share an edge, then faces of islands that are tied; lengths for a surface of area 1.
    curvature : (p,) array
        Across each border without small details, negative in a crease and between islands.
    fine_curvature : (p,) array
        The same with small details.
    thickness : (m,) array
        Logarithm of the radius of the largest inner ball.
    image : (m,) int array or None
        Mirror image of each face at rest, −1 for none; None if the mesh is not symmetric.
    order : (m,) int array
        The faces in an order that depends on the shape alone.
    """

    poses: Sequence[Workpiece]
    areas: FloatArray
    centers: FloatArray
    neighbors: FaceAdjacency
    curvature: FloatArray
    fine_curvature: FloatArray
    thickness: FloatArray
    image: IntArray | None
    order: IntArray

    @classmethod
    def of(
        cls, poses: Sequence[Workpiece], rest: TriangleMesh | None, progress: Progress, cache: Cache | None = None
    ) -> Evidence:
        """Measure the poses of one mesh, which share their faces.

        Parameters
        ----------
        poses
        rest : TriangleMesh or None
            The mesh at rest, which shows its symmetry.
        progress : Progress
        cache : Cache, optional
            Searched for creases and thickness; what is measured is added to it.

        Raises
        ------
        ValueError
            If `rest` has other faces than the first pose.
        """
        # Some measures are of a few of the poses only: which ones must not depend on their order.
        poses = sorted(poses, key=lambda pose: -spread(pose.surface.original))
        first = poses[0]
        if rest is not None and not np.array_equal(rest.faces, first.surface.original.faces):
            raise ValueError("rest has other faces than the first pose: pass the same mesh, in its rest position")
        measured = [poses[i] for i in np.unique(np.linspace(0, len(poses) - 1, MOST_SHAPES).round().astype(int))]
        shapes = [_shape_of(pose, cache, step) for pose, step in progress.each(measured)]
        shared = [i for i, pose in enumerate(measured) if len(pose.neighbors.pairs) == len(first.neighbors.pairs)]
        mean = [np.mean([getattr(shapes[i], name) for i in shared], axis=0) for name in ("coarse", "fine")]
        pairs, lengths = tied_faces(first.surface)
        at_ties = np.full(len(pairs), TIE_CURVATURE)
        mirror = first.surface.mirror
        image = mirrored_faces(rest) if rest is not None else None if mirror is None else mirror.image
        at_rest = first.surface.original if rest is None else rest
        originals = [pose.surface.original for pose in poses]
        edges = FaceAdjacency(
            np.concatenate([first.neighbors.pairs, pairs]),
            np.concatenate([np.mean([measured[i].neighbors.lengths for i in shared], axis=0), lengths]),
        )
        return cls(
            poses,
            np.mean([mesh.face_areas / mesh.area for mesh in originals], axis=0),
            at_rest.unit_face_centers,
            edges,
            np.append(mean[0], at_ties),
            np.append(mean[1], at_ties),
            np.mean([shape.thickness for shape in shapes], axis=0),
            image,
            order_of_faces(at_rest),
        )


def tied_faces(surface: Surface) -> tuple[IntArray, FloatArray]:
    """(t, 2) original faces at the ends of the ties between islands, and (t,) length of the border each stands for."""
    mesh = surface.mesh
    face_at = np.full(mesh.n_vertices, -1)
    own = surface.face_of >= 0
    face_at[mesh.faces[own].ravel()] = np.repeat(surface.face_of[own], 3)
    pairs = face_at[mesh.links]
    known = (pairs >= 0).all(axis=1) & (pairs[:, 0] != pairs[:, 1])
    smaller = (mesh.vertex_areas / mesh.area)[mesh.links].min(axis=1)
    return pairs[known], np.sqrt(smaller[known])


def _shape_of(pose: Workpiece, cache: Cache | None, progress: Progress) -> BorderShape:
    """Creases and thickness of a pose, from a cache if they are there."""

    def compute() -> BorderShape:
        key = ""
        if cache is not None:
            key = content_key(
                ("border shape", SHAPE_VERSION), pose.surface.original.arrays(), pose.surface.mesh.arrays()
            )
            try:
                return BorderShape(**(cache.arrays(key) or {}))
            except TypeError:  # not cached
                progress(0.0)
        shape = border_shape(pose.surface, pose.neighbors, pose.flows, pose.normals, progress)
        if cache is not None:
            try:
                cache.keep(key, vars(shape))
            except OSError as error:
                warnings.warn(
                    Message("creases were not kept for the next time: {reason}", reason=message_of(error)), stacklevel=2
                )
        return shape

    return pose.results.get(ResultKey(Kind.BORDER_SHAPE), (), compute)
