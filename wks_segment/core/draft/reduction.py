"""A mesh in a few cells of its vertices, the same cells in all of its poses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from ..mesh.surface import Connection
from ..mesh.triangle_mesh import FloatArray, IntArray, TriangleMesh, repeats_a_vertex, unique_edges
from ..spectral.coarsening import cluster_vertices

CELLS = 1_000
"""Cells of a mesh, about: enough for fingers of a hand that is large, few enough to be learned in a second."""


@dataclass(frozen=True)
class Reduction:
    """Cells of the vertices of a mesh, and triangles between them; the same for all poses of the mesh.

    Attributes
    ----------
    cell : (n,) int array
        Cell of each vertex; -1 for a vertex that is not on the surface.
    shares : (n,) array
        Share of each vertex in the area of its cell, in the pose that the cells were made of.
    faces : (m', 3) int array
        Cells that meet in a face.
    """

    cell: IntArray
    shares: FloatArray
    faces: IntArray

    @classmethod
    def of(cls, mesh: TriangleMesh, connection: Connection, n_cells: int = CELLS) -> Reduction:
        """About `n_cells` cells of the surface that a connection makes of a mesh.

        A mesh with fewer vertices keeps each of them as a cell.
        """
        faces = connection.welded[mesh.faces][connection.kept]
        used, numbers = np.unique(faces, return_inverse=True)
        faces = numbers.reshape(-1, 3)
        masses = np.bincount(faces.ravel(), np.repeat(mesh.face_areas[connection.kept], 3), len(used))
        masses = (masses + np.finfo(float).eps * masses.sum()).astype(np.float64)
        cell = np.arange(len(used))
        if len(used) > n_cells:
            edges = unique_edges(faces)[0]
            cell = cluster_vertices(mesh.vertices[used], (edges[:, 0], edges[:, 1]), masses, n_cells)[0]
        shares = np.zeros(mesh.n_vertices)
        shares[used] = masses / np.bincount(cell, masses)[cell]
        of_vertices = np.full(mesh.n_vertices, -1)
        of_vertices[used] = cell
        between = cell[faces]
        between = between[~repeats_a_vertex(between)]
        first = np.unique(np.sort(between, axis=1), axis=0, return_index=True)[1]
        return cls(of_vertices[connection.welded], shares, between[np.sort(first)])

    def reduced(self, mesh: TriangleMesh) -> TriangleMesh:
        """A pose of the mesh, with a vertex in the middle of each cell."""
        on = self.shares > 0
        count = int(self.cell.max()) + 1
        places = [np.bincount(self.cell[on], self.shares[on] * axis, count) for axis in mesh.vertices[on].T]
        return TriangleMesh(np.stack(places, axis=1), self.faces)

    def to_faces(self, of_cells: IntArray, mesh: TriangleMesh) -> IntArray:
        """(m,) label of each face of the mesh, which most of its corners have, given the label of each cell."""
        on = np.flatnonzero(self.cell >= 0)
        labels = of_cells[np.maximum(self.cell, 0)]
        off = np.flatnonzero(self.cell < 0)
        if len(off):
            labels[off] = labels[on[cKDTree(mesh.vertices[on]).query(mesh.vertices[off])[1]]]
        a, b, c = labels[mesh.faces].T
        return np.asarray(np.where(b == c, b, a))
