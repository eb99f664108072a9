"""From the mesh that an artist made to the surface that the operator lives on, and back.

An artist's mesh can have a vertex several times at one place (seams of imported files) and too few vertices for
hundreds of eigenpairs. The surface is welded and refined; `Surface` carries values back to the artist's own
vertices and faces.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from .mesh import FloatArray, IntArray, TriangleMesh, repeats_a_vertex

WELD_TOLERANCE = 1e-6
"""Distance under which two border vertices are one, as a fraction of the bounding box's diagonal."""


@dataclass(frozen=True)
class Surface:
    """A welded and refined copy of an original mesh.

    Attributes
    ----------
    original : TriangleMesh
        The mesh as it came.
    mesh : TriangleMesh
        The surface: no two vertices at one place along seams, every vertex in a face, fine enough.
    vertex_of : (n,) int array
        The vertex of `mesh` that stands for each vertex of `original`.
    face_of : (m',) int array
        The face of `original` that each face of `mesh` is a piece of.
    welded_faces : (m, 3) int array
        The faces of `original`, with the vertices of `mesh` as corners: what is adjacent on the surface.
    """

    original: TriangleMesh
    mesh: TriangleMesh
    vertex_of: IntArray
    face_of: IntArray
    welded_faces: IntArray

    @cached_property
    def n_components(self) -> int:
        """Number of loose parts, each with a zero mode of its own."""
        first, second = self.mesh.faces[:, [0, 1]].ravel(), self.mesh.faces[:, [1, 2]].ravel()
        graph = coo_matrix((np.ones(len(first)), (first, second)), shape=(self.mesh.n_vertices,) * 2)
        return int(connected_components(graph, directed=False)[0])

    def to_vertices(self, values: FloatArray) -> FloatArray:
        """Carry (n', …) values at vertices of the surface back to the (n, …) original vertices."""
        return values[self.vertex_of]

    def to_faces(self, values: FloatArray) -> FloatArray:
        """Average (n', k) values at vertices of the surface over each of the (m, k) original faces, by area."""
        areas = self.mesh.face_areas
        sum_over = indicator(self.face_of, self.original.n_faces)
        total = sum_over @ areas
        at_pieces = values[self.mesh.faces].mean(axis=1)
        at_faces = sum_over @ (at_pieces * areas[:, None]) / np.where(total > 0, total, 1)[:, None]
        # A face without area has no piece to average over: its corners speak for it.
        flat = total <= 0
        at_faces[flat] = values[self.welded_faces[flat]].mean(axis=1)
        return at_faces


def prepare_surface(mesh: TriangleMesh, min_vertices: int = 0) -> Surface:
    """Weld a mesh along its seams and refine it, flat, until it has at least `min_vertices` vertices.

    Parameters
    ----------
    mesh : TriangleMesh
        The mesh as it came.
    min_vertices : int
        Each triangle is split into four as often as it takes; 0 leaves the mesh as it is.

    Raises
    ------
    ValueError
        If no face is left after welding.
    """
    vertex_of = weld(mesh)
    welded_faces = vertex_of[mesh.faces]
    face_of = np.flatnonzero(~repeats_a_vertex(welded_faces))
    faces = welded_faces[face_of]
    if not len(faces):
        raise ValueError("every face of the mesh collapses when vertices at the same position are joined")

    used = np.unique(faces)
    compact = np.full(mesh.n_vertices, -1)
    compact[used] = np.arange(len(used))
    vertices, faces = mesh.vertices[used], compact[faces]
    vertex_of = compact[vertex_of]
    stray = np.flatnonzero(vertex_of < 0)
    if stray.size:
        # A vertex without a face still gets a label: that of the surface next to it.
        vertex_of[stray] = cKDTree(vertices).query(mesh.vertices[stray])[1]
    welded_faces = vertex_of[mesh.faces]

    while len(vertices) < min_vertices:
        vertices, faces = _split_in_four(vertices, faces)
        face_of = np.repeat(face_of, 4)
    return Surface(mesh, TriangleMesh(vertices, faces), vertex_of, face_of, welded_faces)


def indicator(owner: IntArray, n_owners: int) -> csr_matrix:
    """(n_owners, len(owner)) sparse matrix that sums what belongs to each owner."""
    return csr_matrix((np.ones(len(owner)), (owner, np.arange(len(owner)))), shape=(n_owners, len(owner)))


def weld(mesh: TriangleMesh) -> IntArray:
    """(n,) for each vertex, the lowest-numbered vertex at the same position that it is joined with.

    Only vertices on open borders are joined: a seam always opens one, while closed lips or a hand that rests on the
    hip touch without being one surface, and do so in some poses only.
    """
    edges = np.sort(mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    unique, count = np.unique(edges, axis=0, return_counts=True)
    border = np.unique(unique[count == 1])
    result = np.arange(mesh.n_vertices)
    if not border.size:
        return result
    positions, group = np.unique(mesh.vertices[border], axis=0, return_inverse=True)
    diagonal = float(np.linalg.norm(np.ptp(mesh.vertices, axis=0)))
    pairs = cKDTree(positions).query_pairs(WELD_TOLERANCE * diagonal, output_type="ndarray")
    near = coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(positions),) * 2)
    group = connected_components(near, directed=False)[1][group.ravel()]
    lowest = np.full(group.max() + 1, mesh.n_vertices)
    np.minimum.at(lowest, group, border)
    result[border] = lowest[group]
    return result


def _split_in_four(vertices: FloatArray, faces: IntArray) -> tuple[FloatArray, IntArray]:
    """Split each triangle at the middles of its edges; the old vertices come first, the children of a face together."""
    edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    unique, edge_of = np.unique(edges, axis=0, return_inverse=True)
    ab, bc, ca = (len(vertices) + edge_of.reshape(-1, 3)).T
    a, b, c = faces.T
    children = np.stack([a, ab, ca, ab, b, bc, ca, bc, c, ab, bc, ca], axis=1).reshape(-1, 3)
    return np.concatenate([vertices, vertices[unique].mean(axis=1)]), children
