"""Frame and order of a mesh that depend on its shape alone, not on its position and turning or on its file.

Ties between equal choices, starts of iterations and approximate searches go by the order and the axes that they find.
In the same frame and order they end alike after an export to another program, so that a model does not change.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from .triangle_mesh import FloatArray, IntArray, TriangleMesh

SLANT = Rotation.from_rotvec((0.6, 0.4, 0.8)).as_matrix()
"""Coordinates are along the principal axes, turned by this: so the vertices of grids and boxes lie at different places
along each, and cells of cubes do not cut a body along its own axes, where the fast solver was three times less exact on
a body with its limbs along them."""


@dataclass(frozen=True)
class Frame:
    """Middle and principal axes of a surface.

    Attributes
    ----------
    middle : (3,) array
    axes : (3, 3) array
        Columns are the principal axes, the longest first, each in the direction of the thinner and longer end.
    """

    middle: FloatArray
    axes: FloatArray

    @classmethod
    def of(cls, mesh: TriangleMesh) -> Frame:
        """Frame of a mesh; a sphere has none of its own, and gets any."""
        weights = mesh.vertex_areas / mesh.area
        middle = weights @ mesh.vertices
        offset = mesh.vertices - middle
        axes = np.linalg.eigh((offset * weights[:, None]).T @ offset)[1][:, ::-1]
        skewed = weights @ (offset @ axes) ** 3
        # A symmetric body is not skewed across its mirror plane: there the direction does not matter.
        return cls(middle, axes * np.where(skewed < 0, -1.0, 1.0))

    def places(self, points: FloatArray) -> FloatArray:
        """(k, 3) coordinates of points in the frame, slanted against its axes."""
        return self.directions(points - self.middle)

    def directions(self, vectors: FloatArray) -> FloatArray:
        """(k, 3) components of vectors in the same coordinates."""
        return np.asarray(vectors @ self.axes @ SLANT)


def spread(mesh: TriangleMesh) -> float:
    """Mean squared distance from the middle, in units of the area: larger the more limbs are stretched out."""
    weights = mesh.vertex_areas / mesh.area
    offset = mesh.vertices - weights @ mesh.vertices
    return float(weights @ np.einsum("ij,ij->i", offset, offset)) / mesh.area


def most_spread(meshes: Sequence[TriangleMesh]) -> TriangleMesh:
    """The mesh, of several poses of one, in the pose whose limbs are stretched out most."""
    return max(meshes, key=spread)


def order_of_faces(mesh: TriangleMesh) -> IntArray:
    """(m,) faces along the first coordinate of the frame; of those at one place, the larger ones first."""
    return np.lexsort((-mesh.face_areas, Frame.of(mesh).places(mesh.face_centers)[:, 0]))


def order_of_vertices(mesh: TriangleMesh) -> IntArray:
    """(n,) vertices along the first coordinate of the frame; of those at one place, the one whose faces come first."""
    frame = Frame.of(mesh)
    along = frame.places(mesh.face_centers)[:, 0]
    of_faces = np.bincount(mesh.faces.ravel(), np.repeat(along, 3), mesh.n_vertices)
    return np.lexsort((of_faces, frame.places(mesh.vertices)[:, 0]))
