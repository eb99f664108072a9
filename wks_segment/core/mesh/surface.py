"""From the mesh that an artist made to the surface that the operator lives on, and back.

An artist's mesh can have a vertex several times at one place (seams of imported files), spikes and holes, loose parts,
and too few vertices for hundreds of eigenpairs. The surface is welded, repaired, refined and tied together; `Surface`
carries values back to the artist's own vertices and faces.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from .islands import ties_between_pieces
from .repair import small_holes, without_spikes
from .subdivision import split_long_edges
from .triangle_mesh import BoolArray, FloatArray, IntArray, TriangleMesh, components_of, repeats_a_vertex, unique_edges

Pieces = Literal["joined", "separate"]
"""Loose parts tied to what they are nearest to, or each with a spectrum of its own."""

WELD_TOLERANCE = 1e-6
"""Distance under which two border vertices are one, as a fraction of the bounding box's diagonal …"""
WELD_SHARE = 0.01
"""… and of the median edge at most: a vertex far away makes the box large."""
LEAST_PIECE = {"joined": 1e-6, "separate": 1e-3}
"""A loose part below this share of the area stays out of the operator. By itself it would cost a zero mode and say
nothing."""
EDGE = 1.4
"""Longest edge, in units of the square root of the area of a vertex: even triangles have edges of 1.07."""
MOST_NEW = 4
"""Vertices that refining adds at most, in units of those asked for: thin triangles would need very many."""
MOST_PIECES = {"joined": 1000, "separate": 100}
"""Loose parts that the operator sees at most, the largest ones."""


@dataclass(frozen=True)
class Surface:
    """A welded and refined copy of an original mesh.

    Attributes
    ----------
    original : TriangleMesh
        The mesh as it came.
    mesh : TriangleMesh
        The surface: no two vertices at one place along seams, every vertex in a face, no spikes, small holes closed,
        fine enough, loose parts linked.
    vertex_of : (n,) int array
        The vertex of `mesh` that stands for each vertex of `original`; the nearest one, for vertices without a face
        and those of loose parts that are left out.
    face_of : (m',) int array
        The face of `original` that each face of `mesh` is a piece of; -1 for those that close a hole.
    welded_faces : (m, 3) int array
        The faces of `original`, with one number for all vertices at one place: what is adjacent on the surface.
    """

    original: TriangleMesh
    mesh: TriangleMesh
    vertex_of: IntArray
    face_of: IntArray
    welded_faces: IntArray

    @property
    def n_components(self) -> int:
        """Number of loose parts of `mesh`, each with a zero mode of its own."""
        return int(self.mesh.components.max()) + 1

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
        # A face that is not on the surface, or has no area, has no piece to average over: its corners speak for it.
        without = total <= 0
        at_faces[without] = values[self.vertex_of[self.original.faces[without]]].mean(axis=1)
        return at_faces


@dataclass(frozen=True)
class Connection:
    """What is one surface, decided once for all poses of a mesh.

    Attributes
    ----------
    welded : (n,) int array
        For each vertex, the lowest-numbered vertex that it is joined with.
    kept : (m,) bool array
        Whether each face takes part in the operator.
    ties : (t, 2) int array
        Pairs of welded vertices that tie loose parts together.
    """

    welded: IntArray
    kept: BoolArray
    ties: IntArray


def connect(*poses: TriangleMesh, rest: TriangleMesh | None = None, pieces: Pieces = "joined") -> Connection:
    """Find out what is one surface in all poses of one mesh: what is welded, what takes part, what is tied together.

    Parameters
    ----------
    poses
        The same faces between vertices at other places; pieces that meet in some poses only stay apart in all.
    rest : TriangleMesh, optional
        The same mesh as it was modeled. Loose parts are then tied as they are there, and so in the same way for poses
        that are not here.
    pieces : "joined" or "separate"
        Whether loose parts are tied together.

    Raises
    ------
    ValueError
        If no face is left after welding.
    """
    welded = weld(*poses, *([] if rest is None else [rest]))
    first = poses[0] if rest is None else rest
    faces = welded[first.faces]
    kept = ~repeats_a_vertex(faces)
    if not kept.any():
        raise ValueError("every face of the mesh collapses when vertices at the same position are joined")
    kept[kept] = _in_large_pieces(first, faces[kept], pieces)
    ties = np.zeros((0, 2), dtype=np.int64)
    if pieces == "joined":
        ties = ties_between_pieces(faces[kept], *(pose.vertices for pose in (poses if rest is None else [rest])))
    return Connection(welded, kept, ties)


def connect_alike(meshes: Sequence[TriangleMesh], names: Sequence[str], pieces: Pieces = "joined") -> list[Connection]:
    """`connect` for several meshes, those with the same faces as poses of one; errors begin with a mesh's name."""
    found: list[Connection] = []
    alike = [next(j for j, other in enumerate(meshes) if np.array_equal(mesh.faces, other.faces)) for mesh in meshes]
    for i, first in enumerate(alike):
        group = [mesh for mesh, other in zip(meshes, alike, strict=True) if other == i]
        try:
            found.append(connect(*group, pieces=pieces) if first == i else found[first])
        except ValueError as error:
            raise ValueError(f"{names[i]}: {error}") from error
    return found


def prepare_surface(
    mesh: TriangleMesh, min_vertices: int = 0, connection: Connection | None = None, pieces: Pieces = "joined"
) -> Surface:
    """Weld a mesh along its seams, repair it, refine it, flat, to `min_vertices` vertices at least, and tie its parts.

    Parameters
    ----------
    mesh : TriangleMesh
        The mesh as it came.
    min_vertices : int
        Edges are halved until all are as short as those of so many evenly spread vertices; 0 leaves them as they are.
    connection : Connection, optional
        What `connect` gave for all poses of the mesh, so that it is one surface in all of them.
    pieces : "joined" or "separate"
        For a mesh that comes alone.

    Raises
    ------
    ValueError
        If no face is left after welding.
    """
    connection = connection or connect(mesh, pieces=pieces)
    welded_faces = connection.welded[mesh.faces]
    face_of = np.flatnonzero(connection.kept)
    faces = welded_faces[face_of]

    used = np.unique(faces)
    compact = np.full(mesh.n_vertices, -1)
    compact[used] = np.arange(len(used))
    vertices, faces = mesh.vertices[used], compact[faces]
    vertex_of = np.full(mesh.n_vertices, -1)
    vertex_of[mesh.faces] = compact[welded_faces]
    outside = np.flatnonzero(vertex_of < 0)
    if outside.size:
        vertex_of[outside] = cKDTree(vertices).query(mesh.vertices[outside])[1]

    surface = TriangleMesh(without_spikes(vertices, faces), faces)
    middles, caps = small_holes(surface)
    vertices, faces = np.concatenate([surface.vertices, middles]), np.concatenate([faces, caps])
    face_of = np.append(face_of, np.full(len(caps), -1))
    if min_vertices:
        longest = EDGE * np.sqrt(surface.area / min_vertices)
        vertices, faces, piece_of = split_long_edges(vertices, faces, longest, len(vertices) + MOST_NEW * min_vertices)
        face_of = face_of[piece_of]
    # Caps and refinement leave the old vertices where they were in the list.
    links = compact[connection.ties]
    if len(vertices) > surface.n_vertices or len(links):
        surface = TriangleMesh(vertices, faces, links)
    return Surface(mesh, surface, vertex_of, face_of, welded_faces)


def _in_large_pieces(mesh: TriangleMesh, faces: IntArray, pieces: Pieces) -> BoolArray:
    """(m',) whether each face belongs to a loose part that is large enough for the operator."""
    piece = components_of(faces, mesh.n_vertices)[faces[:, 0]]
    if (piece == piece[0]).all():
        return np.ones(len(faces), dtype=bool)
    corners = mesh.vertices[faces]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    size = np.bincount(piece, weights=areas)
    largest_first = np.argsort(-size, kind="stable")
    large = np.zeros(len(size), dtype=bool)
    large[largest_first[: MOST_PIECES[pieces]]] = True
    worth_it = size >= LEAST_PIECE[pieces] * size.sum()
    return (large & worth_it if worth_it.any() else large)[piece]


def indicator(owner: IntArray, n_owners: int) -> csr_matrix:
    """(n_owners, len(owner)) sparse matrix that sums what belongs to each owner; -1: to none."""
    owned = np.flatnonzero(owner >= 0)
    return csr_matrix((np.ones(len(owned)), (owner[owned], owned)), shape=(n_owners, len(owner)))


def weld(*poses: TriangleMesh) -> IntArray:
    """(n,) for each vertex, the lowest-numbered vertex that it is joined with: at the same position in all poses.

    Joined are vertices on open borders and the ends of edges without length. Not others: a seam always opens a border,
    while closed lips or a hand that rests on the hip touch without being one surface, and do so in some poses only.
    """
    groups = np.stack([_same_position(mesh) for mesh in poses])
    group = np.unique(groups, axis=1, return_inverse=True)[1].ravel() if len(poses) > 1 else groups[0]
    lowest = np.full(group.max() + 1, len(group))
    np.minimum.at(lowest, group, np.arange(len(group)))
    return lowest[group]


def _same_position(mesh: TriangleMesh) -> IntArray:
    """(n,) number of the group of joined vertices that each vertex is in."""
    edges, _, count = unique_edges(mesh.faces)
    length = np.linalg.norm(mesh.vertices[edges[:, 0]] - mesh.vertices[edges[:, 1]], axis=1)
    used = np.zeros(mesh.n_vertices, dtype=bool)
    used[edges] = True
    diagonal = float(np.linalg.norm(np.ptp(mesh.vertices[used], axis=0)))
    tolerance = min(WELD_TOLERANCE * diagonal, WELD_SHARE * float(np.median(length)))
    joined = [edges[length <= tolerance]]
    border = np.unique(edges[count == 1])
    if border.size:
        # Exactly equal ones first: a soup of triangles has many, and the search for near ones would list every pair.
        positions, first, same = np.unique(mesh.vertices[border], axis=0, return_index=True, return_inverse=True)
        joined.append(np.stack([border, border[first[same.ravel()]]], axis=1))
        near = cKDTree(positions).query_pairs(tolerance, output_type="ndarray")
        joined.append(border[first[near]])
    a, b = np.concatenate(joined).T
    graph = coo_matrix((np.ones(len(a), dtype=np.int8), (a, b)), shape=(mesh.n_vertices,) * 2)
    return connected_components(graph, directed=False)[1].astype(np.int64)
