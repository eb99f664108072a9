"""Triangle mesh that is checked once when it is made, and helpers for arrays of faces, edges and pairs."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..message import Message

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]


class TriangleMesh:
    """Vertices and triangles, validated and read-only.

    Parameters
    ----------
    vertices : (n, 3) array of float
        Positions, in any unit.
    faces : (m, 3) array of int
        Vertex indices of each triangle, in either orientation.
    links : (l, 2) array of int, optional
        Pairs of vertices that count as neighbors without an edge: they tie islands together.
    lengths : (m, 3) array of float, optional
        Lengths of the edges ab, bc and ca of each triangle, if they are not the distances between its corners (see
        `delaunay`). A face may then use a vertex twice.
    layers : int
        Number of times that the faces cover the surface; each face counts with its area divided by this number.

    Raises
    ------
    ValueError
        If an array has the wrong shape, a coordinate is not finite, an index is out of range, a face uses a vertex
        twice, there is no face, or the surface has no area. The message names the first such vertex or face.

    Examples
    --------
    >>> from wks_segment.core import TriangleMesh
    >>> mesh = TriangleMesh([[0, 0, 0], [2, 0, 0], [0, 2, 0]], [[0, 1, 2]])
    >>> mesh.n_vertices, float(mesh.area)
    (3, 2.0)
    """

    def __init__(
        self,
        vertices: ArrayLike,
        faces: ArrayLike,
        links: ArrayLike | None = None,
        lengths: ArrayLike | None = None,
        layers: int = 1,
    ) -> None:
        self.layers = layers
        self.vertices: FloatArray = _checked_vertices(vertices)
        self.faces: IntArray = _checked_faces(faces, len(self.vertices), may_repeat=lengths is not None)
        self.links: IntArray = _checked_links(links, len(self.vertices))
        self._lengths = None if lengths is None else _checked_lengths(lengths, len(self.faces))
        if not self.area > 0:
            raise ValueError("the mesh has no area: all its faces are points or lines; check the scale of the mesh")
        self.vertices.setflags(write=False)
        self.faces.setflags(write=False)
        self.links.setflags(write=False)

    def with_unit_area(self, place: IntArray | None = None) -> TriangleMesh:
        """Mesh scaled to area 1, its vertices reordered so that vertex i becomes vertex `place[i]`, if given."""
        scale = 1 / np.sqrt(self.area)
        lengths = None if self._lengths is None else self._lengths * scale
        vertices, faces, links = self.vertices * scale, self.faces, self.links
        if place is not None:
            moved = np.empty_like(vertices)
            moved[place] = vertices
            vertices, faces, links = moved, place[faces], place[links]
        return TriangleMesh(vertices, faces, links, lengths, self.layers)

    def at(self, places: FloatArray) -> TriangleMesh:
        """The same mesh with other positions of its vertices; its lengths stay if they were given."""
        return TriangleMesh(places, self.faces, self.links, self._lengths, self.layers)

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Arrays from which `of_arrays` makes the same mesh again."""
        arrays = {"vertices": self.vertices, "faces": self.faces, "links": self.links, "layers": np.array(self.layers)}
        return arrays if self._lengths is None else {**arrays, "lengths": self._lengths}

    @classmethod
    def of_arrays(cls, arrays: Mapping[str, NDArray[Any]]) -> TriangleMesh:
        """Mesh from the result of `arrays`; raises KeyError or ValueError for anything else."""
        return cls(arrays["vertices"], arrays["faces"], arrays["links"], arrays.get("lengths"), int(arrays["layers"]))

    @property
    def n_vertices(self) -> int:
        """Number of vertices."""
        return len(self.vertices)

    @property
    def n_faces(self) -> int:
        """Number of triangles."""
        return len(self.faces)

    @cached_property
    def lengths(self) -> FloatArray:
        """(m, 3) lengths of the edges ab, bc and ca of each triangle, in units of the vertices."""
        return edge_lengths(self.vertices, self.faces) if self._lengths is None else self._lengths

    @cached_property
    def face_areas(self) -> FloatArray:
        """(m,) area of each triangle, in squared units of the vertices."""
        if self._lengths is not None:
            return areas_of_lengths(self._lengths) / self.layers
        a, b, c = (self.vertices[self.faces[:, i]] for i in range(3))
        areas: FloatArray = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
        areas.setflags(write=False)
        return areas

    @property
    def area(self) -> float:
        """Area of the surface, in squared units of the vertices."""
        return float(self.face_areas.sum())

    @cached_property
    def face_centers(self) -> FloatArray:
        """(m, 3) center of each triangle: the mean of its corners."""
        centers: FloatArray = self.vertices[self.faces].mean(axis=1)
        centers.setflags(write=False)
        return centers

    @property
    def unit_face_centers(self) -> FloatArray:
        """(m, 3) center of each triangle, in units of the square root of the area."""
        return np.asarray(self.face_centers / np.sqrt(self.area))

    @cached_property
    def vertex_areas(self) -> FloatArray:
        """(n,) area of each vertex: a third of the triangles around it (barycentric lumping)."""
        thirds = np.repeat(self.face_areas / 3, 3)
        return np.bincount(self.faces.ravel(), weights=thirds, minlength=self.n_vertices).astype(np.float64)

    @cached_property
    def islands(self) -> IntArray:
        """(n,) island of each vertex, numbered 0, 1, …; tied islands count as one, a vertex without face is one."""
        return islands_of_vertices(self.faces, self.n_vertices, self.links)

    @property
    def components(self) -> IntArray:
        """The former name of `islands`, for scripts that use it."""
        return self.islands

    def __repr__(self) -> str:
        return f"TriangleMesh({self.n_vertices} vertices, {self.n_faces} faces)"


def _checked_vertices(vertices: ArrayLike) -> FloatArray:
    array = np.array(vertices, dtype=np.float64)
    if array.ndim != 2 or array.shape[1] != 3:
        raise ValueError(Message("vertices must have the shape (n, 3), not {shape}", shape=array.shape))
    bad = np.flatnonzero(~np.isfinite(array).all(axis=1))
    if bad.size:
        raise ValueError(
            Message(
                "vertex {vertex} has a coordinate that is not finite: {position} ({count} such vertices in all)",
                vertex=bad[0],
                position=array[bad[0]].tolist(),
                count=bad.size,
            )
        )
    return array


def _checked_faces(faces: ArrayLike, n_vertices: int, may_repeat: bool) -> IntArray:
    array = np.array(faces)
    if array.size == 0:
        raise ValueError("the mesh has no faces")
    if array.ndim != 2 or array.shape[1] != 3:
        raise ValueError(
            Message("faces must have the shape (m, 3), not {shape}; triangulate the mesh first", shape=array.shape)
        )
    if not np.issubdtype(array.dtype, np.integer):
        raise ValueError(Message("faces must be integers (indices of vertices), not {type}", type=array.dtype))
    array = array.astype(np.int64)
    bad = np.flatnonzero(((array < 0) | (array >= n_vertices)).any(axis=1))
    if bad.size:
        raise ValueError(
            Message(
                "face {face} uses a vertex that does not exist: {corners}, the mesh has {n_vertices} vertices "
                "({count} such faces in all)",
                face=bad[0],
                corners=array[bad[0]].tolist(),
                n_vertices=n_vertices,
                count=bad.size,
            )
        )
    bad = np.flatnonzero(repeats_a_vertex(array))
    if bad.size and not may_repeat:
        raise ValueError(
            Message(
                "face {face} uses a vertex twice: {corners} ({count} such faces in all)",
                face=bad[0],
                corners=array[bad[0]].tolist(),
                count=bad.size,
            )
        )
    return array


def _checked_links(links: ArrayLike | None, n_vertices: int) -> IntArray:
    array = np.array([] if links is None else links, dtype=np.int64).reshape(-1, 2)
    if ((array < 0) | (array >= n_vertices)).any():
        raise ValueError(
            Message(
                "a link uses a vertex that does not exist; the mesh has {n_vertices} vertices", n_vertices=n_vertices
            )
        )
    return array


def _checked_lengths(lengths: ArrayLike, n_faces: int) -> FloatArray:
    array = np.array(lengths, dtype=np.float64)
    if array.shape != (n_faces, 3) or not np.isfinite(array).all() or (array < 0).any():
        raise ValueError(
            Message("lengths must be {n_faces} × 3 finite numbers, none of them negative", n_faces=n_faces)
        )
    array.setflags(write=False)
    return array


def connected_groups(pairs: IntArray, count: int) -> IntArray:
    """(count,) connected group of each node of a graph with (p, 2) edges, numbered 0, 1, … by the lowest node."""
    import scipy  # late, since Blender imports this module when it starts

    first, second = pairs.T
    graph = scipy.sparse.coo_matrix((np.ones(len(pairs), dtype=np.int8), (first, second)), shape=(count, count))
    return scipy.sparse.csgraph.connected_components(graph, directed=False)[1].astype(np.int64)


def islands_of_vertices(faces: IntArray, n_vertices: int, links: IntArray | None = None) -> IntArray:
    """(n,) island of each vertex, numbered 0, 1, …; islands that (l, 2) links tie count as one."""
    pairs = [faces[:, [0, 1]], faces[:, [1, 2]], *([] if links is None else [links])]
    return connected_groups(np.concatenate(pairs), n_vertices)


def edge_lengths(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """(m, 3) lengths of the edges ab, bc and ca of each triangle."""
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    return np.stack([np.sqrt(np.einsum("ij,ij->i", d, d)) for d in (b - a, c - b, a - c)], axis=1)


def areas_of_lengths(lengths: FloatArray) -> FloatArray:
    """(m,) areas of triangles with (m, 3) lengths of edges, by Kahan's form of Heron's formula."""
    c, b, a = np.sort(lengths, axis=1).T
    product = (a + (b + c)) * (c - (a - b)) * (c + (a - b)) * (a + (b - c))
    return np.asarray(np.sqrt(np.maximum(product, 0)) / 4)


def edges_of(faces: IntArray) -> IntArray:
    """(3 m, 2) edges of each triangle in turn, the lower vertex first; an edge of two triangles occurs twice."""
    return np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)


def unique_edges(faces: IntArray) -> tuple[IntArray, IntArray, IntArray]:
    """(e, 2) distinct edges of triangles; (3 m,) index of each row of `edges_of` in them; (e,) faces at each edge."""
    edges = edges_of(faces)
    base = int(edges.max()) + 1
    # One number for each edge: ten times as fast to sort as pairs.
    keys, which, count = np.unique(edges @ np.array([base, 1]), return_inverse=True, return_counts=True)
    return np.stack([keys // base, keys % base], axis=1), which, count


def repeats_a_vertex(faces: IntArray) -> BoolArray:
    """(m,) whether a triangle uses a vertex more than once, and so has no area."""
    a, b, c = faces.T
    return np.asarray((a == b) | (b == c) | (c == a))
