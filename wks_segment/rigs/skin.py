"""The faces of a character, and how much each bone moves each vertex."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..core.mesh.triangle_mesh import FloatArray, IntArray
from ..core.message import Message

SAME_POINT_SHARE = 1e-5
"""Share of the size within which vertices are at the same place: exporters cut meshes along seams of UV maps."""


@dataclass(frozen=True, eq=False)
class Skin:
    """Faces with any number of corners, and the weights of bones.

    Attributes
    ----------
    vertices : (n, 3) array
    corners : tuple of two (c,) int arrays
        Vertex and face of each corner, in the order of the faces.
    areas : (m,) array
        Area of each face.
    weights : (n, b) array or sparse matrix
        Weight of each bone at each vertex; any row may be zero.
    """

    vertices: FloatArray
    corners: tuple[IntArray, IntArray]
    areas: FloatArray
    weights: Any

    def __post_init__(self) -> None:
        if self.weights.shape[0] != len(self.vertices):
            raise ValueError(
                Message(
                    "there are weights of {weights} vertices, but the mesh has {vertices}",
                    weights=self.weights.shape[0], vertices=len(self.vertices),
                )
            )  # fmt: skip

    @classmethod
    def of_triangles(cls, vertices: FloatArray, faces: IntArray, weights: Any) -> Skin:
        """The skin of a mesh of triangles."""
        a, b, c = np.moveaxis(np.asarray(vertices)[faces], 1, 0)
        areas = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
        return cls(np.asarray(vertices), (faces.ravel(), np.repeat(np.arange(len(faces)), 3)), areas, weights)

    def bone_of_faces(self) -> IntArray:
        """(m,) bone with most weight on the corners of each face; −1 where no bone has weight."""
        from scipy.sparse import csr_matrix  # Blender imports this module when it starts

        vertex, face = self.corners
        weights = csr_matrix(self.weights)
        of_corners = csr_matrix((np.ones(len(vertex)), (face, vertex)), shape=(len(self.areas), len(self.vertices)))
        sums = (of_corners @ weights).tocsr()
        if not sums.shape[1]:
            return np.full(len(self.areas), -1)
        heaviest = np.asarray(sums.argmax(axis=1)).ravel()
        most = sums.max(axis=1).toarray().ravel()
        return np.where(most > 0, heaviest, -1).astype(np.int64)

    def borders(self, of_faces: IntArray, count: int) -> FloatArray:
        """(count, count) number of places where faces of two numbers, from `of_faces`, meet."""
        from scipy.sparse import csr_matrix

        vertex, face = self.corners
        size = float(np.ptp(self.vertices, axis=0).max()) if len(self.vertices) else 0.0
        cells = np.round(self.vertices / (SAME_POINT_SHARE * size or 1.0)).astype(np.int64)
        place = np.unique(cells, axis=0, return_inverse=True)[1].ravel()
        number = of_faces[face]
        used = number >= 0
        shape = int(place.max(initial=-1)) + 1, count
        meets = csr_matrix((np.ones(int(used.sum())), (place[vertex[used]], number[used])), shape=shape)
        meets.data[:] = 1.0
        return np.asarray((meets.T @ meets).toarray())
