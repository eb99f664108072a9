"""Intrinsic Delaunay triangulation: better triangles on the same surface and vertices, by edge flips.

Bobenko and Springborn, "A discrete Laplace–Beltrami operator for simplicial surfaces" (2007). A flipped edge runs
across faces that meet at an angle, so a triangle is given by three lengths, not by three positions. All flips that do
not affect each other are made at once.

Ours because the library `robust_laplacian` gives the same eigenvalues to 1e-12, except on degenerate triangles, and
would add 2.6 MB for every platform (docs/reliability.md).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from ..mesh.triangle_mesh import BoolArray, FloatArray, IntArray, TriangleMesh, areas_of_lengths, unique_edges
from .laplacian import half_cotangents

Laplacian = Literal["cotangent", "delaunay"]

SLIVER_SHARE = 0.08
"""Negative share of the total edge weight above which a mesh counts as full of slivers; ordinary meshes have half of
it. Without slivers the flips gain nothing ("Which Laplacian" in docs/reliability.md)."""
WEIGHT_TOLERANCE = 1e-9
"""Magnitude of a negative edge weight that needs no flip."""
LEAST_SLACK = 1e-8
"""Least difference between two sides of a triangle and the third one, in mean edges, so that degenerate triangles can
be laid out flat (Sharp and Crane, "A Laplacian for nonmanifold triangle meshes" (2020), section 4.5). Their value of
1e-5 would already change a triangle that is two hundred times as long as wide."""
MAX_FLIP_ROUNDS = 500
"""Most rounds of flips. A dozen is usual, and after each of them the triangulation is valid."""


def is_full_of_slivers(mesh: TriangleMesh) -> bool:
    """Whether so much edge weight is negative that flips are worth their time."""
    weights = np.bincount(
        unique_edges(mesh.faces)[1].ravel(), weights=half_cotangents(mesh.lengths, mesh.face_areas).ravel()
    )
    return float(np.maximum(-weights, 0).sum()) > SLIVER_SHARE * float(np.abs(weights).sum())


def better_triangles(mesh: TriangleMesh, laplacian: Literal["auto"] | Laplacian) -> tuple[TriangleMesh, Laplacian]:
    """The mesh whose cotangents are used, and its kind: "cotangent" for the mesh itself, or "delaunay"."""
    if laplacian == "delaunay" or (laplacian == "auto" and is_full_of_slivers(mesh)):
        return delaunay(mesh), "delaunay"
    return mesh, "cotangent"


def delaunay(mesh: TriangleMesh) -> TriangleMesh:
    """Intrinsic Delaunay triangulation of a surface: no edge has a negative cotangent weight.

    If the mesh has borders, or edges with more than two faces, the surface is covered twice, by the fronts and the
    backs of its faces. Around such an edge the front of each face is joined to the back of the next one. The cover has
    no border and two faces at every edge (Sharp and Crane, section 3.3: the tufted cover).

    Parameters
    ----------
    mesh : TriangleMesh
        With n vertices and m faces, in any orientation.

    Returns
    -------
    Mesh with the same n vertices and m faces, or 2 m faces in two layers, with `lengths`. A face may use a vertex
    twice: an edge can run around a thin limb and end where it begins.

    Examples
    --------
    >>> from examples.tube import tube
    >>> from wks_segment.core import delaunay, stiffness_matrix
    >>> weights = stiffness_matrix(delaunay(tube(0.5, around=5)))
    >>> bool((weights - weights.multiply(weights > 0)).nnz)  # off the diagonal all are negative or zero
    True
    """
    _, edge, count = unique_edges(mesh.faces)
    layers = 1 if (count == 2).all() else 2
    state = _Triangulation.of(mesh, edge.ravel(), count, layers)
    for _ in range(MAX_FLIP_ROUNDS):
        sides = state.sides_to_flip()
        if not len(sides):
            break
        state = state.flipped(sides)
    return TriangleMesh(mesh.vertices, state.corners.reshape(-1, 3), mesh.links, state.lengths.reshape(-1, 3), layers)


@dataclass(frozen=True)
class _Triangulation:
    """Triangles that are joined side to side. Side 3 f + i of face f runs from its corner i to corner i + 1.

    Attributes
    ----------
    corners : (3 m,) int array
        Vertex at which each side begins.
    lengths : (3 m,) array
        Length of each side.
    twin : (3 m,) int array
        Side of the neighbor that each side is joined to.
    parallel : (3 m,) bool array
        Whether a side and its twin run in the same direction; otherwise in opposite ones.
    unchecked : (3 m,) bool array
        Whether a side may have to be flipped: a face next to it has changed since it was checked.
    """

    corners: IntArray
    lengths: FloatArray
    twin: IntArray
    parallel: BoolArray
    unchecked: BoolArray

    @classmethod
    def of(cls, mesh: TriangleMesh, edge: IntArray, count: IntArray, layers: int) -> _Triangulation:
        """Join the faces of a mesh, given the edge on which each side lies and the number of faces at each edge."""
        lengths = mesh.lengths
        slack = lengths.sum(axis=1) - 2 * lengths.max(axis=1)
        # The same for all edges, so that the faces of an edge agree; 0 if no triangle is degenerate.
        lengths = lengths + max(0.0, LEAST_SLACK * float(lengths.mean()) - float(slack.min()))
        corners = mesh.faces.ravel()
        order = np.lexsort((_angles_around_edges(mesh, count[edge] > 2), edge))
        first = np.flatnonzero(np.diff(edge[order], prepend=-1))
        following = np.arange(1, len(order) + 1)
        following[np.append(first[1:], len(order)) - 1] = first  # around an edge, the first side follows the last
        here, there = order, order[following]
        twin = np.empty(layers * len(corners), dtype=np.int64)
        if layers == 1:
            twin[here] = there
        else:
            # The front of a face points forward around an edge if its side runs along it, and backward otherwise.
            along = corners < np.roll(mesh.faces, -1, axis=1).ravel()
            ahead = here + np.where(along[here], 0, len(corners))
            behind = there + np.where(along[there], len(corners), 0)
            twin[ahead], twin[behind] = behind, ahead
        corners, lengths = np.tile(corners, layers), np.tile(lengths.ravel(), layers)
        return cls(corners, lengths, twin, corners[twin] == corners, np.ones(len(corners), dtype=bool))

    def sides_to_flip(self) -> IntArray:
        """Sides to flip, one of each pair of twins: those with the most negative weight in both of their faces."""
        sides = np.flatnonzero(self.unchecked & (self.twin > np.arange(len(self.twin))))
        sides = sides[sides // 3 != self.twin[sides] // 3]
        weight = self._half_cotangent(sides) + self._half_cotangent(self.twin[sides])
        self.unchecked[sides[weight >= -WEIGHT_TOLERANCE]] = False
        negative = weight < -WEIGHT_TOLERANCE
        sides, weight = sides[negative], weight[negative]
        order = np.argsort(-weight, kind="stable")
        sides = sides[order]
        # Sides are in the order from best to worst, so the worst side of a face is written last.
        worst = np.full(len(self.twin) // 3, -1)
        faces = np.stack([sides, self.twin[sides]]) // 3
        worst[faces.T.ravel()] = np.repeat(sides, 2)
        return np.asarray(sides[(worst[faces] == sides).all(axis=0)])

    def _half_cotangent(self, sides: IntArray) -> FloatArray:
        """Half the cotangent of the angle opposite to each of the given sides."""
        first = sides - sides % 3
        lengths = np.stack([self.lengths[first + (sides + i) % 3] for i in range(3)], axis=1)
        return half_cotangents(lengths, areas_of_lengths(lengths))[:, 0]

    def flipped(self, sides: IntArray) -> _Triangulation:
        """Triangulation in which each of the given sides is replaced by the other diagonal of its two faces.

        For side ab of face abc, whose twin is in a face with the third corner d, the faces become c a d and d b c.
        """
        ab = sides
        base, other = ab - ab % 3, self.twin[ab] - self.twin[ab] % 3
        bc, ca = base + (ab + 1) % 3, base + (ab + 2) % 3
        next_, last = other + (self.twin[ab] + 1) % 3, other + (self.twin[ab] + 2) % 3
        turned = self.parallel[ab]  # then the twin also runs from a to b
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

        twin, parallel = self.twin.copy(), self.parallel.copy()
        outer = np.concatenate([ca, ad, db, bc])
        across = self.twin[outer]
        new, new_across = moved[outer], moved[across]
        direction = self.parallel[outer] ^ reversed_[outer] ^ reversed_[across]
        twin[new], twin[new_across] = new_across, new
        parallel[new], parallel[new_across] = direction, direction
        twin[base + 2], twin[other + 2] = other + 2, base + 2
        parallel[base + 2], parallel[other + 2] = False, False
        unchecked = self.unchecked.copy()
        unchecked[base + 2], unchecked[other + 2] = False, False
        unchecked[new], unchecked[new_across] = True, True
        return replace(self, corners=corners, lengths=lengths, twin=twin, parallel=parallel, unchecked=unchecked)


def _other_diagonal(ab: FloatArray, bc: FloatArray, ca: FloatArray, ad: FloatArray, db: FloatArray) -> FloatArray:
    """Distance from c to d, for two triangles that share the side ab and are laid out flat."""
    x = (ab**2 + ca**2 - bc**2) / (2 * ab)
    u = (ab**2 + ad**2 - db**2) / (2 * ab)
    y, v = np.sqrt(np.maximum(ca**2 - x**2, 0)), np.sqrt(np.maximum(ad**2 - u**2, 0))
    return np.asarray(np.hypot(x - u, y + v))


def _angles_around_edges(mesh: TriangleMesh, wanted: BoolArray) -> FloatArray:
    """(3 m,) angle around the edge of each wanted side at which its face leaves the edge; 0 for other sides."""
    angles = np.zeros(len(wanted))
    sides = np.flatnonzero(wanted)
    ends = np.stack([mesh.faces.ravel(), np.roll(mesh.faces, -1, axis=1).ravel()], axis=1)[sides]
    start, end = mesh.vertices[ends.min(axis=1)], mesh.vertices[ends.max(axis=1)]
    axis = end - start
    axis /= np.maximum(np.linalg.norm(axis, axis=1), np.finfo(float).tiny)[:, None]
    # Angles start at any direction across the axis, the same one for all faces of an edge.
    across = np.cross(axis, np.eye(3)[np.abs(axis).argmin(axis=1)])
    away = mesh.vertices[np.roll(mesh.faces, -2, axis=1).ravel()[sides]] - start
    dot = np.einsum("ij,ij->i", away, across)
    angles[sides] = np.arctan2(np.einsum("ij,ij->i", away, np.cross(axis, across)), dot)
    return angles
