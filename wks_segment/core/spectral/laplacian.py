"""The Laplace–Beltrami operator by linear finite elements: stiffness and mass matrix.

Pinkall and Polthier, "Computing discrete minimal surfaces and their conjugates" (1993). Borders need no extra code: the
natural boundary condition of finite elements is Neumann's.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import csc_matrix, csr_matrix, diags

from ..mesh.triangle_mesh import FloatArray, TriangleMesh

MIN_DOUBLE_AREA = 1e-4
"""Least double area of a triangle in the cotangents, as a fraction of its longest edge squared. Larger weights of
thinner triangles would hardly change the functions there, but would cost single precision its digits."""
LINK_WEIGHT = 1.0
"""Weight of a link: of the order of an edge between two equilateral triangles, which has 0.58."""
MIN_MASS = 1e-3
"""Least mass of a vertex, as a fraction of the mean: slivers can leave a vertex none, and M must have an inverse."""


def stiffness_matrix(mesh: TriangleMesh) -> csc_matrix:
    """Stiffness matrix S of the cotangent weights.

    S_ij = −(cot α_ij + cot β_ij) / 2 for an edge ij with opposite angles α, β; −1 for a link; S_ii = −Σ_j S_ij.

    Parameters
    ----------
    mesh : TriangleMesh
        With n vertices. A face without area counts as a very thin one, so that all weights are finite.

    Returns
    -------
    (n, n) symmetric, positive semi-definite sparse matrix; without unit (it does not change with scale).

    Examples
    --------
    >>> from examples.tube import tube
    >>> from wks_segment.core import stiffness_matrix
    >>> bool(abs(stiffness_matrix(tube(0.5)).sum(axis=1)).max() < 1e-9)  # a constant has no energy
    True
    """
    i, j = mesh.faces.ravel(), np.roll(mesh.faces, -1, axis=1).ravel()
    i, j = np.append(i, mesh.links[:, 0]), np.append(j, mesh.links[:, 1])
    edge_weights = half_cotangents(mesh.lengths, mesh.face_areas * mesh.layers) / mesh.layers
    weight = np.append(edge_weights.ravel(), np.full(len(mesh.links), LINK_WEIGHT))
    weights = csr_matrix((np.append(weight, weight), (np.append(i, j), np.append(j, i))), shape=(mesh.n_vertices,) * 2)
    return csc_matrix(diags(np.asarray(weights.sum(axis=1)).ravel()) - weights)


def half_cotangents(lengths: FloatArray, areas: FloatArray) -> FloatArray:
    """(m, 3) half the cotangent of the angle opposite to each edge, from (m, 3) lengths of edges and (m,) areas."""
    squared = lengths**2
    floor = MIN_DOUBLE_AREA * squared.max(axis=1)
    # cot γ = (a² + b² − c²) / (4 · area), with c opposite to γ
    double_area = np.maximum(2 * areas, np.where(floor > 0, floor, 1))
    return np.asarray((squared.sum(axis=1)[:, None] - 2 * squared) / (4 * double_area[:, None]))


def mass_matrix(mesh: TriangleMesh, lumped: bool = True) -> csc_matrix:
    """Mass matrix M: the areas of the vertices.

    Parameters
    ----------
    mesh : TriangleMesh
        With n vertices.
    lumped : bool
        True: diagonal, with a third of the area of the triangles around each vertex. False: the consistent matrix of
        linear elements (a sixth of the area of a triangle on the diagonal, a twelfth off the diagonal).

    Returns
    -------
    (n, n) symmetric sparse matrix in squared units of the vertices; its entries sum to the area.

    Examples
    --------
    >>> from examples.tube import tube
    >>> from wks_segment.core import mass_matrix
    >>> mesh = tube(0.5)
    >>> bool(abs(mass_matrix(mesh).sum() - mesh.area) < 1e-9)
    True
    """
    if lumped:
        return csc_matrix(diags(mesh.vertex_areas))
    i = np.repeat(mesh.faces, 3, axis=1).ravel()
    j = np.tile(mesh.faces, 3).ravel()
    local = np.repeat(mesh.face_areas, 9) / 12 * (1 + (i == j))
    return csc_matrix(csr_matrix((local, (i, j)), shape=(mesh.n_vertices,) * 2))


def unit_area_masses(mesh: TriangleMesh) -> FloatArray:
    """(n,) lumped masses of the surface scaled to area 1, none of them below `MIN_MASS` times the mean."""
    masses = mesh.vertex_areas / mesh.area
    return np.maximum(masses, MIN_MASS * masses.mean())
