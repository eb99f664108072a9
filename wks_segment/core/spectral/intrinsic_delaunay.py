"""The same surface between the same vertices, with better triangles: intrinsic Delaunay by flips of edges.

Bobenko and Springborn, "A discrete Laplace–Beltrami operator for simplicial surfaces" (2007). Flipped edges run across
the faces of the mesh, which bend along them: a triangle is three lengths, not three places. All flips that do not
disturb each other are made at once.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from ..mesh.triangle_mesh import BoolArray, FloatArray, IntArray, TriangleMesh, areas_of_lengths, unique_edges
from .laplacian import half_cotangents

Laplacian = Literal["cotangent", "delaunay"]

SLIVERS = 0.08
"""Share of the edges' weight that is negative from which a mesh counts as full of slivers; half of it on usual ones."""
TOLERANCE = 1e-9
"""How negative the weight of an edge may stay."""
LEAST_SLACK = 1e-8
"""Two sides of a triangle exceed the third by this many mean edges at least, so that degenerate ones can be unfolded
(Sharp and Crane, "A Laplacian for nonmanifold triangle meshes" (2020), section 4.5). Theirs is 1e-5: it would fatten
a triangle of a two-hundredth of its length."""
MAX_ROUNDS = 500
"""Rounds of flips. A dozen is usual, and each of them leaves a valid triangulation."""


def is_full_of_slivers(mesh: TriangleMesh) -> bool:
    """Whether so many edges have a negative cotangent weight that flips pay."""
    weights = np.bincount(
        unique_edges(mesh.faces)[1].ravel(), weights=half_cotangents(mesh.lengths, mesh.face_areas).ravel()
    )
    return float(np.maximum(-weights, 0).sum()) > SLIVERS * float(np.abs(weights).sum())


def better_triangles(mesh: TriangleMesh, laplacian: Literal["auto"] | Laplacian) -> tuple[TriangleMesh, Laplacian]:
    """The mesh to take the cotangents of, and whether it is "cotangent", as it was, or "delaunay"."""
    if laplacian == "delaunay" or (laplacian == "auto" and is_full_of_slivers(mesh)):
        return delaunay(mesh), "delaunay"
    return mesh, "cotangent"


def delaunay(mesh: TriangleMesh) -> TriangleMesh:
    """The intrinsic Delaunay triangulation of a surface: no edge has a negative cotangent weight.

    A surface with borders or with edges of three and more faces is covered twice, front and back, as by a tight bag;
    around such an edge, each face's front is sewn to the back of the next one. The bag has no border and two faces at
    every edge, whatever the mesh (Sharp and Crane, section 3.3: the tufted cover).

    Parameters
    ----------
    mesh : TriangleMesh
        With n vertices and m faces, in any orientation.

    Returns
    -------
    The same n vertices and m faces, or 2 m in two layers, with `lengths`. A face may name a vertex twice (an edge that
    runs around a thin limb, and ends where it began).
    """
    _, edge, count = unique_edges(mesh.faces)
    layers = 1 if (count == 2).all() else 2
    state = _Flips.of(mesh, edge.ravel(), count, layers)
    for _ in range(MAX_ROUNDS):
        chosen = state.choose()
        if not len(chosen):
            break
        state = state.flipped(chosen)
    return TriangleMesh(mesh.vertices, state.corners.reshape(-1, 3), mesh.links, state.lengths.reshape(-1, 3), layers)


@dataclass(frozen=True)
class _Flips:
    """Triangles that are sewn side to side. Side 3 f + i of face f runs from its corner i to corner i + 1.

    Attributes
    ----------
    corners : (3 m,) int array
        Vertex at which each side begins.
    lengths : (3 m,) array
    twin : (3 m,) int array
        The side of the neighbor that each is sewn to.
    alike : (3 m,) bool array
        Whether twins run in the same direction: faces of mixed orientation.
    unsure : (3 m,) bool array
        Sides that may have to be flipped: none of the triangles beside the others has changed.
    """

    corners: IntArray
    lengths: FloatArray
    twin: IntArray
    alike: BoolArray
    unsure: BoolArray

    @classmethod
    def of(cls, mesh: TriangleMesh, edge: IntArray, count: IntArray, layers: int) -> _Flips:
        """Sew the faces of a mesh together, given the edge that each side lies on and how many faces that has."""
        lengths = mesh.lengths
        slack = lengths.sum(axis=1) - 2 * lengths.max(axis=1)
        # The same for all edges, so that both faces of one agree; nothing if all is well.
        lengths = lengths + max(0.0, LEAST_SLACK * float(lengths.mean()) - float(slack.min()))
        corners = mesh.faces.ravel()
        order = np.lexsort((_angles_around_edges(mesh, count[edge] > 2), edge))
        first = np.flatnonzero(np.diff(edge[order], prepend=-1))
        following = np.arange(1, len(order) + 1)
        following[np.append(first[1:], len(order)) - 1] = first  # around the edge, the first comes after the last
        here, there = order, order[following]
        twin = np.empty(layers * len(corners), dtype=np.int64)
        if layers == 1:
            twin[here] = there
        else:
            # The front of a face looks forward around the edges along which it runs, backward around the others.
            along = corners < np.roll(mesh.faces, -1, axis=1).ravel()
            ahead = here + np.where(along[here], 0, len(corners))
            behind = there + np.where(along[there], len(corners), 0)
            twin[ahead], twin[behind] = behind, ahead
        corners, lengths = np.tile(corners, layers), np.tile(lengths.ravel(), layers)
        return cls(corners, lengths, twin, corners[twin] == corners, np.ones(len(corners), dtype=bool))

    def choose(self) -> IntArray:
        """The sides to flip, one of each pair of twins: the worst one of both of its faces."""
        sides = np.flatnonzero(self.unsure & (self.twin > np.arange(len(self.twin))))
        sides = sides[sides // 3 != self.twin[sides] // 3]
        weight = self._half_cotangent(sides) + self._half_cotangent(self.twin[sides])
        self.unsure[sides[weight >= -TOLERANCE]] = False
        bad = weight < -TOLERANCE
        sides, weight = sides[bad], weight[bad]
        order = np.argsort(-weight, kind="stable")
        sides = sides[order]
        # The last one that is written is the worst.
        worst = np.full(len(self.twin) // 3, -1)
        faces = np.stack([sides, self.twin[sides]]) // 3
        worst[faces.T.ravel()] = np.repeat(sides, 2)
        return np.asarray(sides[(worst[faces] == sides).all(axis=0)])

    def _half_cotangent(self, sides: IntArray) -> FloatArray:
        """Half the cotangent of the angle opposite to each side."""
        first = sides - sides % 3
        three = np.stack([self.lengths[first + (sides + i) % 3] for i in range(3)], axis=1)
        return half_cotangents(three, areas_of_lengths(three))[:, 0]

    def flipped(self, sides: IntArray) -> _Flips:
        """Each of the sides replaced by the other diagonal of its two faces.

        Side ab of face abc and its twin in the face with corner d: the faces become c a d and d b c.
        """
        ab = sides
        base, other = ab - ab % 3, self.twin[ab] - self.twin[ab] % 3
        bc, ca = base + (ab + 1) % 3, base + (ab + 2) % 3
        next_, last = other + (self.twin[ab] + 1) % 3, other + (self.twin[ab] + 2) % 3
        turned = self.alike[ab]  # then the twin runs from a to b too
        ad, db = np.where(turned, last, next_), np.where(turned, next_, last)
        a, b, c, d = self.corners[ab], self.corners[bc], self.corners[ca], self.corners[last]
        diagonal = _other_diagonal(*(self.lengths[side] for side in (ab, bc, ca, ad, db)))

        corners, lengths = self.corners.copy(), self.lengths.copy()
        moved, reversed_ = np.arange(len(corners)), np.zeros(len(corners), dtype=bool)
        for face, begins, old in ((base, (c, a, d), (ca, ad, None)), (other, (d, b, c), (db, bc, None))):
            for i in range(3):
                corners[face + i] = begins[i]
                side = old[i]
                lengths[face + i] = diagonal if side is None else self.lengths[side]
                if side is not None:
                    moved[side] = face + i
        reversed_[ad], reversed_[db] = turned, turned

        twin, alike = self.twin.copy(), self.alike.copy()
        outer = np.concatenate([ca, ad, db, bc])
        across = self.twin[outer]
        new, new_across = moved[outer], moved[across]
        direction = self.alike[outer] ^ reversed_[outer] ^ reversed_[across]
        twin[new], twin[new_across] = new_across, new
        alike[new], alike[new_across] = direction, direction
        twin[base + 2], twin[other + 2] = other + 2, base + 2
        alike[base + 2], alike[other + 2] = False, False
        unsure = self.unsure.copy()
        unsure[base + 2], unsure[other + 2] = False, False
        unsure[new], unsure[new_across] = True, True
        return replace(self, corners=corners, lengths=lengths, twin=twin, alike=alike, unsure=unsure)


def _other_diagonal(ab: FloatArray, bc: FloatArray, ca: FloatArray, ad: FloatArray, db: FloatArray) -> FloatArray:
    """Distance from c to d of two triangles that share the side ab, laid out flat."""
    x = (ab**2 + ca**2 - bc**2) / (2 * ab)
    u = (ab**2 + ad**2 - db**2) / (2 * ab)
    y, v = np.sqrt(np.maximum(ca**2 - x**2, 0)), np.sqrt(np.maximum(ad**2 - u**2, 0))
    return np.asarray(np.hypot(x - u, y + v))


def _angles_around_edges(mesh: TriangleMesh, wanted: BoolArray) -> FloatArray:
    """(3 m,) direction in which a face leaves the edge of each side that is wanted, as an angle around it; else 0."""
    angles = np.zeros(len(wanted))
    many = np.flatnonzero(wanted)
    ends = np.stack([mesh.faces.ravel(), np.roll(mesh.faces, -1, axis=1).ravel()], axis=1)[many]
    start, end = mesh.vertices[ends.min(axis=1)], mesh.vertices[ends.max(axis=1)]
    axis = end - start
    axis /= np.maximum(np.linalg.norm(axis, axis=1), np.finfo(float).tiny)[:, None]
    # Any direction across the axis will do to count from, but the same for all faces of an edge.
    across = np.cross(axis, np.eye(3)[np.abs(axis).argmin(axis=1)])
    away = mesh.vertices[np.roll(mesh.faces, -2, axis=1).ravel()[many]] - start
    dot = np.einsum("ij,ij->i", away, across)
    angles[many] = np.arctan2(np.einsum("ij,ij->i", away, np.cross(axis, across)), dot)
    return angles
