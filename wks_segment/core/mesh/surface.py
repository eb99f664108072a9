"""Surface: the welded, repaired and refined copy of a mesh on which eigenpairs are computed, and the way back.

A user's mesh can have several vertices at one position (seams of imported files), spikes, holes, islands, and too few
vertices for hundreds of eigenpairs. The surface is welded, repaired and refined, and its islands are tied together.
`Surface` carries values back to the vertices and faces of the mesh.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix, csr_matrix
from scipy.spatial import cKDTree

from ..message import Message, message_of
from .canonical import Frame, most_spread, order_of_faces, order_of_vertices
from .islands import ties_between_islands
from .mirror import Mirror, mirror_of
from .repair import caps_of_small_holes, without_spikes
from .subdivision import split_long_edges
from .triangle_mesh import (
    BoolArray,
    FloatArray,
    IntArray,
    TriangleMesh,
    connected_groups,
    islands_of_vertices,
    repeats_a_vertex,
    unique_edges,
)

IslandMode = Literal["joined", "separate"]
"""What happens to the islands of a mesh: each is tied to the nearest one, or has a spectrum of its own."""

WELD_TOLERANCE = 1e-6
"""Largest distance between two border vertices that are welded, as a fraction of the bounding box's diagonal: rounding
of imported files is below it."""
WELD_EDGE_SHARE = 0.01
"""The same as a fraction of the median edge; the smaller of both counts, since one far vertex makes the box large."""
LEAST_ISLAND_SHARE = {"joined": 1e-6, "separate": 1e-3}
"""Islands below this share of the area are left out of the surface. A separate one would cost a zero mode of its own
and tell nothing."""
MOST_ISLANDS = {"joined": 1000, "separate": 100}
"""Largest number of islands in the surface; the largest ones stay."""
LONGEST_EDGE = 1.4
"""Longest edge after refinement, in units of the square root of a vertex's area; edges of equilateral triangles measure
1.07."""
MOST_NEW_VERTICES = 4
"""Most vertices that refinement adds, in units of `min_vertices`: thin triangles would need very many."""


@dataclass(frozen=True)
class Surface:
    """A welded, repaired and refined copy of a mesh.

    Attributes
    ----------
    original : TriangleMesh
        The mesh as it was given.
    mesh : TriangleMesh
        The copy: seams welded, every vertex in a face, no spikes, small holes closed, edges short enough, islands
        tied. It lies in its own frame, and its vertices and faces are in an order of their own, so that it is the same
        wherever the original lies and in whatever order it is written.
    vertex_of : (n,) int array
        The vertex of `mesh` that stands for each vertex of `original`: for a vertex without a face or of an island that
        is left out, the nearest one.
    face_of : (m',) int array
        The face of `original` that contains each face of `mesh`; -1 for faces that close a hole.
    welded_faces : (m, 3) int array
        The faces of `original` with one number for all vertices that are welded: neighbors on the surface share edges.
    mirror : Mirror or None
        Mirror images of the faces of `original`, at rest; None if it is not symmetric.

    Examples
    --------
    >>> from examples.tube import tube
    >>> from wks_segment.core import prepare_surface
    >>> surface = prepare_surface(tube(0.5))
    >>> surface.n_islands, round(float(surface.mesh.area), 6)
    (1, 1.0)
    """

    original: TriangleMesh
    mesh: TriangleMesh
    vertex_of: IntArray
    face_of: IntArray
    welded_faces: IntArray
    mirror: Mirror | None = None

    @property
    def n_islands(self) -> int:
        """Number of islands of `mesh`, each with a zero mode of its own; islands that are tied count as one."""
        return int(self.mesh.islands.max()) + 1

    @property
    def n_components(self) -> int:
        """The former name of `n_islands`, for scripts that use it."""
        return self.n_islands

    def to_vertices(self, values: FloatArray) -> FloatArray:
        """(n, …) values at the original vertices, from (n', …) values at the vertices of the surface."""
        return values[self.vertex_of]

    def to_faces(self, values: FloatArray) -> FloatArray:
        """(m, k) area-weighted means over the original faces, of (n', k) values at the vertices of the surface."""
        return np.asarray(self._face_means @ values)

    def from_faces(self, values: FloatArray) -> FloatArray:
        """(n', k) area-weighted means around the vertices of the surface, of (m, k) values at the original faces.

        Faces that close a hole count as 0.
        """
        own, areas = self.face_of >= 0, self.mesh.face_areas
        entries = np.repeat(areas[own], 3), (self.mesh.faces[own].ravel(), np.repeat(self.face_of[own], 3))
        sums = csr_matrix(entries, shape=(self.mesh.n_vertices, self.original.n_faces))
        total = np.bincount(self.mesh.faces.ravel(), np.repeat(areas, 3), self.mesh.n_vertices)
        return np.asarray(sums @ values / np.maximum(total, np.finfo(float).tiny)[:, None])

    @cached_property
    def _face_means(self) -> csr_matrix:
        """(m, n') matrix that takes the area-weighted mean over each original face."""
        areas, own = self.mesh.face_areas, self.face_of >= 0
        total = np.bincount(self.face_of[own], areas[own], self.original.n_faces)
        # A face that is not on the surface, or has no area, takes the mean of its corners.
        without = np.flatnonzero(total <= 0)
        shares = areas[own] / np.where(total > 0, total, 1)[self.face_of[own]]
        weights = np.append(shares, np.ones(len(without)))
        rows = np.append(self.face_of[own], without)
        corners = np.concatenate([self.mesh.faces[own], self.vertex_of[self.original.faces[without]]])
        entries = np.repeat(weights / 3, 3), (np.repeat(rows, 3), corners.ravel())
        return csr_matrix(entries, shape=(self.original.n_faces, self.mesh.n_vertices))


@dataclass(frozen=True)
class Connection:
    """Welding, faces and ties of a surface, decided once for all poses of a mesh.

    Attributes
    ----------
    welded : (n,) int array
        The lowest vertex that each vertex is welded with, possibly itself.
    kept : (m,) bool array
        Whether each face is part of the surface.
    ties : (t, 2) int array
        Pairs of welded vertices that tie islands together.
    vertices : (n,) int array
        The vertices in an order that depends on the shape alone.
    faces : (m,) int array
        The faces in such an order.
    mirror : Mirror or None
        Mirror images of the faces at rest, or in the most symmetric pose; None if the mesh is not symmetric.

    Examples
    --------
    >>> from examples.tube import tube
    >>> from wks_segment.core import connect, prepare_surface
    >>> connection = connect(tube(0.0), tube(1.0))
    >>> prepare_surface(tube(0.5), connection=connection).n_islands
    1
    """

    welded: IntArray
    kept: BoolArray
    ties: IntArray
    vertices: IntArray
    faces: IntArray
    mirror: Mirror | None = None

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Arrays by name, to tell whether two connections are the same."""
        mirror = {} if self.mirror is None else {"image": self.mirror.image, "side": self.mirror.side}
        order = {"vertices": self.vertices, "faces": self.faces}
        return {"welded": self.welded, "kept": self.kept, "ties": self.ties, **order, **mirror}


def connect(*poses: TriangleMesh, rest: TriangleMesh | None = None, pieces: IslandMode = "joined") -> Connection:
    """Decide what the surface of all poses of one mesh is: which vertices are welded, which islands are kept and tied.

    Parameters
    ----------
    poses
        Meshes with the same faces and other positions. Vertices that meet in some poses only are not welded.
    rest : TriangleMesh, optional
        The same mesh in its rest position. Islands are then tied where they are near to each other there, so that
        the ties do not depend on the given poses.
    pieces : "joined" or "separate"
        Whether islands are tied together.

    Raises
    ------
    ValueError
        If no face is left after welding.

    Examples
    --------
    >>> from examples.tube import tube
    >>> from wks_segment.core import connect
    >>> connection = connect(tube(0.0), tube(1.0))  # two poses of one mesh
    >>> len(connection.ties)  # it is one island
    0
    """
    welded = weld(*poses, *([] if rest is None else [rest]))
    first = poses[0] if rest is None else rest
    faces = welded[first.faces]
    kept = ~repeats_a_vertex(faces)
    if not kept.any():
        raise ValueError("every face of the mesh collapses when vertices at the same position are joined")
    kept[kept] = _in_large_islands(first, faces[kept], pieces)
    at_rest = most_spread(poses) if rest is None else rest
    vertex_order, face_order = order_of_vertices(at_rest), order_of_faces(at_rest)
    ties = np.zeros((0, 2), dtype=np.int64)
    if pieces == "joined":
        number = np.empty_like(vertex_order)
        number[vertex_order] = np.arange(len(number))
        in_order = face_order[kept[face_order]]
        places = [pose.vertices[vertex_order] for pose in (poses if rest is None else [rest])]
        ties = vertex_order[ties_between_islands(number[faces[in_order]], *places)]
    mirror = mirror_of(poses if rest is None else [rest])
    return Connection(welded, kept, ties, vertex_order, face_order, mirror)


def connect_alike(
    meshes: Sequence[TriangleMesh], names: Sequence[str], pieces: IslandMode = "joined"
) -> list[Connection]:
    """`connect` for several meshes; those with the same faces are poses of one mesh. Errors begin with a name."""
    connections: list[Connection] = []
    firsts = [next(j for j, other in enumerate(meshes) if np.array_equal(mesh.faces, other.faces)) for mesh in meshes]
    for i, first in enumerate(firsts):
        poses = [mesh for mesh, other in zip(meshes, firsts, strict=True) if other == i]
        try:
            connections.append(connect(*poses, pieces=pieces) if first == i else connections[first])
        except ValueError as error:
            raise ValueError(Message("{name}: {reason}", name=names[i], reason=message_of(error))) from error
    return connections


def prepare_surface(
    mesh: TriangleMesh, min_vertices: int = 0, connection: Connection | None = None, pieces: IslandMode = "joined"
) -> Surface:
    """Weld a mesh along its seams, repair it, refine it to at least `min_vertices` vertices, and tie its islands.

    Refinement adds vertices on edges and so does not change the shape, which is moved and scaled to area 1.

    Parameters
    ----------
    mesh : TriangleMesh
    min_vertices : int
        Edges are halved until none is longer than with this number of evenly spread vertices; 0: no refinement.
    connection : Connection, optional
        Result of `connect` for all poses of the mesh, so that the surface is the same in all of them.
    pieces : "joined" or "separate"
        Whether islands are tied together, if no `connection` is given.

    Raises
    ------
    ValueError
        If no face is left after welding.

    Examples
    --------
    >>> from examples.tube import tube
    >>> from wks_segment.core import prepare_surface
    >>> tube(0.5).n_vertices, prepare_surface(tube(0.5), min_vertices=900).mesh.n_vertices > 900
    (290, True)
    """
    connection = connection or connect(mesh, pieces=pieces)
    welded_faces = connection.welded[mesh.faces]
    face_of = connection.faces[connection.kept[connection.faces]]
    faces = welded_faces[face_of]

    in_use = np.zeros(mesh.n_vertices, dtype=bool)
    in_use[faces] = True
    used = connection.vertices[in_use[connection.vertices]]
    compact = np.full(mesh.n_vertices, -1)
    compact[used] = np.arange(len(used))
    vertices, faces = mesh.vertices[used], _lowest_first(compact[faces])
    vertex_of = np.full(mesh.n_vertices, -1)
    vertex_of[mesh.faces] = compact[welded_faces]
    outside = np.flatnonzero(vertex_of < 0)
    if outside.size:
        vertex_of[outside] = cKDTree(vertices).query(mesh.vertices[outside])[1]

    surface = TriangleMesh(without_spikes(vertices, faces), faces)
    cap_vertices, caps = caps_of_small_holes(surface)
    vertices, faces = np.concatenate([surface.vertices, cap_vertices]), np.concatenate([faces, caps])
    face_of = np.append(face_of, np.full(len(caps), -1))
    if min_vertices:
        longest = LONGEST_EDGE * np.sqrt(surface.area / min_vertices)
        most_vertices = len(vertices) + MOST_NEW_VERTICES * min_vertices
        vertices, faces, parent = split_long_edges(vertices, faces, longest, most_vertices)
        face_of = face_of[parent]
    # Caps and refinement append vertices, so the numbers in the ties stay valid.
    ties = compact[connection.ties]
    if len(vertices) > surface.n_vertices or len(ties):
        surface = TriangleMesh(vertices, faces, ties)
    surface = surface.at(Frame.of(surface).places(surface.vertices))
    return Surface(mesh, surface, vertex_of, face_of, welded_faces, connection.mirror)


def _in_large_islands(mesh: TriangleMesh, faces: IntArray, pieces: IslandMode) -> BoolArray:
    """(m',) whether each face belongs to an island that is large enough for the surface."""
    island = islands_of_vertices(faces, mesh.n_vertices)[faces[:, 0]]
    if (island == island[0]).all():
        return np.ones(len(faces), dtype=bool)
    corners = mesh.vertices[faces]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    size = np.bincount(island, weights=areas)
    largest_first = np.argsort(-size, kind="stable")
    among_largest = np.zeros(len(size), dtype=bool)
    among_largest[largest_first[: MOST_ISLANDS[pieces]]] = True
    large = size >= LEAST_ISLAND_SHARE[pieces] * size.sum()
    return (among_largest & large if large.any() else among_largest)[island]


def _lowest_first(faces: IntArray) -> IntArray:
    """(m, 3) the same faces, each beginning with its lowest vertex."""
    corners = (faces.argmin(axis=1)[:, None] + np.arange(3)) % 3
    return np.take_along_axis(faces, corners, axis=1)


def shares_at_vertices(surface: Surface, region: IntArray, count: int) -> FloatArray:
    """(n', count) share of each region in the area around each vertex of the surface.

    Given the region of each original face, 0 to `count` − 1; -1 for a face without a region.
    """
    mesh = surface.mesh
    inside_any = (surface.face_of >= 0) & (region[surface.face_of] >= 0)
    areas, faces, owner = mesh.face_areas[inside_any], mesh.faces[inside_any], region[surface.face_of[inside_any]]
    entries = np.repeat(areas, 3), (faces.ravel(), np.repeat(owner, 3))
    inside: FloatArray = coo_matrix(entries, shape=(mesh.n_vertices, count)).toarray()
    return inside / np.maximum(inside.sum(axis=1, keepdims=True), np.finfo(float).tiny)


def indicator(owner: IntArray, n_owners: int) -> csr_matrix:
    """(n_owners, k) sparse matrix that sums k values by their owner, given the owner of each (-1: none)."""
    owned = np.flatnonzero(owner >= 0)
    return csr_matrix((np.ones(len(owned)), (owner[owned], owned)), shape=(n_owners, len(owner)))


def weld(*poses: TriangleMesh) -> IntArray:
    """(n,) lowest vertex that each vertex is welded with: both are at the same position in all poses.

    Only vertices on open borders and the ends of edges without length are welded: a seam always has an open border,
    while closed lips, or a hand that rests on the hip, touch without being one surface, and only in some poses.
    """
    groups = np.stack([_same_position(mesh) for mesh in poses])
    group = np.unique(groups, axis=1, return_inverse=True)[1].ravel() if len(poses) > 1 else groups[0]
    lowest = np.full(group.max() + 1, len(group))
    np.minimum.at(lowest, group, np.arange(len(group)))
    return lowest[group]


def _same_position(mesh: TriangleMesh) -> IntArray:
    """(n,) group of each vertex: the vertices that would be welded if this pose were the only one."""
    edges, _, count = unique_edges(mesh.faces)
    length = np.linalg.norm(mesh.vertices[edges[:, 0]] - mesh.vertices[edges[:, 1]], axis=1)
    used = np.zeros(mesh.n_vertices, dtype=bool)
    used[edges] = True
    diagonal = float(np.linalg.norm(np.ptp(mesh.vertices[used], axis=0)))
    tolerance = min(WELD_TOLERANCE * diagonal, WELD_EDGE_SHARE * float(np.median(length)))
    pairs = [edges[length <= tolerance]]
    border = np.unique(edges[count == 1])
    if border.size:
        # Equal positions first: a triangle soup has many, and the search for near positions would list every pair.
        positions, first, same = np.unique(mesh.vertices[border], axis=0, return_index=True, return_inverse=True)
        pairs.append(np.stack([border, border[first[same.ravel()]]], axis=1))
        near = cKDTree(positions).query_pairs(tolerance, output_type="ndarray")
        pairs.append(border[first[near]])
    return connected_groups(np.concatenate(pairs), mesh.n_vertices)
