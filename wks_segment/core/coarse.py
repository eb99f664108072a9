"""A coarse space for smooth functions on a surface: cells of vertices, and local linear functions over them.

The low eigenfunctions vary slowly, so that a few values a wavelength tell them apart. The space need not be accurate,
only rich enough; inverse iteration on the surface itself does the rest (`spectrum`).
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix, diags, identity
from scipy.sparse.csgraph import connected_components

from .mesh import FloatArray, IntArray, TriangleMesh

HEAVIEST = 1.5
"""A cell of more than this many times the mean mass is split: on a thin limb, a cube of space holds a whole tube."""
LIGHTEST = 0.2
"""A cell of less than this many times the mean mass joins a neighbour, if it does not become too heavy."""
SPLITS = 5
"""Rounds of splitting, each into half the size."""
REACH = 1.8
"""Radius of a cell's function, in square roots of a cell's mean area."""
LEAST_WEIGHT = 1e-3
"""Weight of a vertex's own cell if even its middle is out of reach."""
RIDGE = 1e-2
"""Pulls a fit without enough neighbours towards a constant."""
DAMPING = 0.66
"""Of the smoothing step on the functions, in units of the inverse diagonal."""


def edges_of(matrix: csr_matrix) -> tuple[IntArray, IntArray]:
    """The two ends of each edge in the graph of a symmetric sparse matrix."""
    entries = matrix.tocoo()
    once = entries.row < entries.col
    return entries.row[once], entries.col[once]


def cluster(
    positions: FloatArray, edges: tuple[IntArray, IntArray], masses: FloatArray, n_cells: int
) -> tuple[IntArray, int]:
    """(n,) cell of each vertex, and how many there are: about `n_cells`, connected, none of them much too heavy.

    Cubes of space, cut where the surface is not connected within them; those that still hold too much of it are cut
    again at half the size.
    """
    first, second = edges
    mean = masses.sum() / n_cells
    size = np.sqrt(mean)
    cell = np.zeros(len(positions), dtype=np.int64)
    too_heavy = np.ones(len(positions), dtype=bool)
    corner = positions.min(axis=0)
    for _ in range(SPLITS):
        cube = np.floor((positions - corner) / size).astype(np.int64)
        cube -= cube.min(axis=0)
        spans = cube.max(axis=0) + 1
        number = (cube[:, 0] * spans[1] + cube[:, 1]) * spans[2] + cube[:, 2]
        together = (cell[first] == cell[second]) & (
            (number[first] == number[second]) | ~(too_heavy[first] & too_heavy[second])
        )
        cell, count = _components(first[together], second[together], len(positions))
        mass = _sums(masses, cell, count)
        too_heavy = mass[cell] > HEAVIEST * mean
        if not too_heavy.any():
            break
        size /= 2
    return _join_light_cells(cell, edges, mass, mean)


def _sums(values: FloatArray, owner: IntArray, count: int) -> FloatArray:
    """(count,) sum of the values that belong to each owner."""
    return np.bincount(owner, weights=values, minlength=count).astype(np.float64)


def _components(first: IntArray, second: IntArray, n: int) -> tuple[IntArray, int]:
    graph = coo_matrix((np.ones(len(first), dtype=np.int8), (first, second)), shape=(n, n))
    count, label = connected_components(graph, directed=False)
    return label.astype(np.int64), int(count)


def _join_light_cells(
    cell: IntArray, edges: tuple[IntArray, IntArray], mass: FloatArray, mean: float
) -> tuple[IntArray, int]:
    """Let light cells join the neighbour with which they share most edges."""
    a, b = cell[edges[0]], cell[edges[1]]
    a, b = np.concatenate([a, b]), np.concatenate([b, a])
    fits = (mass[a] < LIGHTEST * mean) & (mass[b] >= LIGHTEST * mean) & (mass[a] + mass[b] < HEAVIEST * mean) & (a != b)
    shared = coo_matrix((np.ones(fits.sum()), (a[fits], b[fits])), shape=(len(mass),) * 2).tocsr()
    target = np.arange(len(mass))
    joins = np.diff(shared.indptr) > 0
    if joins.any():
        target[joins] = np.asarray(shared.argmax(axis=1)).ravel()[joins]
    kept, result = np.unique(target[cell], return_inverse=True)
    return result.astype(np.int64), len(kept)


def prolongation(mesh: TriangleMesh, masses: FloatArray, stiffness: csr_matrix, n_cells: int) -> csr_matrix:
    """(n, about n_cells) sparse matrix: from values at cells to smooth functions on the surface.

    Moving least squares (Lancaster and Salkauskas, 1981) in the tangent plane of each vertex, over its own and the
    adjacent cells, with Wendland's weights: sums to 1 and carries over functions that are linear there. One damped
    Jacobi step takes the roughness out of the functions.

    Parameters
    ----------
    mesh : TriangleMesh
        Of area 1, with n vertices.
    masses : (n,) array
    stiffness : (n, n) sparse matrix
    n_cells : int
        How many cells to aim at.
    """
    n = mesh.n_vertices
    edges = edges_of(stiffness)
    cell, count = cluster(mesh.vertices, edges, masses, n_cells)
    middle = _middle_vertices(mesh.vertices, masses, cell, count)
    row, column = _own_and_adjacent(cell, count, edges)

    across = mesh.vertices[middle[column]] - mesh.vertices[row]
    reach = REACH / np.sqrt(n_cells)
    distance = np.linalg.norm(across, axis=1) / reach
    weight = np.where(distance < 1, (1 - distance) ** 4 * (4 * distance + 1), 0.0)
    weight = np.where(column == cell[row], np.maximum(weight, LEAST_WEIGHT), weight)
    near = weight > 0
    row, column, across, weight = row[near], column[near], across[near] / reach, weight[near]
    tangent, other = _tangents(_normals(mesh))
    u = np.einsum("ij,ij->i", across, tangent[row])
    v = np.einsum("ij,ij->i", across, other[row])

    def moment(values: FloatArray) -> FloatArray:
        return _sums(values, row, n)

    # The constant term of the weighted fit of 1, u, v, by Cramer's rule.
    w, wu, wv = moment(weight), moment(weight * u), moment(weight * v)
    wuu, wvv, wuv = moment(weight * u * u), moment(weight * v * v), moment(weight * u * v)
    wuu, wvv = wuu + RIDGE * w, wvv + RIDGE * w
    constant, by_u, by_v = wuu * wvv - wuv**2, wv * wuv - wu * wvv, wu * wuv - wv * wuu
    determinant = w * constant + wu * by_u + wv * by_v
    values = weight * (constant[row] + by_u[row] * u + by_v[row] * v) / determinant[row]
    basis = csr_matrix((values, (row, column)), shape=(n, count))
    inverse_diagonal = 1 / np.maximum(stiffness.diagonal(), np.finfo(float).tiny)
    return csr_matrix(basis - DAMPING * (diags(inverse_diagonal) @ (stiffness @ basis)))


def _middle_vertices(positions: FloatArray, masses: FloatArray, cell: IntArray, count: int) -> IntArray:
    """(count,) the vertex of each cell that is nearest to its centre of mass."""
    mass = _sums(masses, cell, count)
    centre = np.stack([_sums(masses * x, cell, count) for x in positions.T], axis=1)
    away = ((positions - (centre / mass[:, None])[cell]) ** 2).sum(axis=1)
    order = np.lexsort((away, cell))
    return order[np.searchsorted(cell[order], np.arange(count))]


def _own_and_adjacent(cell: IntArray, count: int, edges: tuple[IntArray, IntArray]) -> tuple[IntArray, IntArray]:
    """Pairs of a vertex and a cell: its own, and those that touch its own."""
    a, b = cell[edges[0]], cell[edges[1]]
    touch = csr_matrix((np.ones(len(a), dtype=np.int8), (a, b)), shape=(count, count))
    touch = csr_matrix(touch + touch.T + identity(count, dtype=np.int8, format="csr")) != 0
    size = np.diff(touch.indptr)[cell]
    start = np.repeat(touch.indptr[cell] - np.concatenate([[0], np.cumsum(size)[:-1]]), size)
    return np.repeat(np.arange(len(cell)), size), touch.indices[start + np.arange(size.sum())]


def _normals(mesh: TriangleMesh) -> FloatArray:
    """(n, 3) unit normals; zero where the faces around a vertex cancel."""
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    of_faces = np.repeat(np.cross(b - a, c - a), 3, axis=0)
    at = mesh.faces.ravel()
    normals = np.stack([_sums(x, at, mesh.n_vertices) for x in of_faces.T], axis=1)
    return normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), np.finfo(float).tiny)


def _tangents(normals: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Two unit vectors at right angles to each normal and each other."""
    helper = np.where(np.abs(normals[:, :1]) < 0.6, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    tangent = np.cross(normals, helper)
    tangent /= np.maximum(np.linalg.norm(tangent, axis=1, keepdims=True), np.finfo(float).tiny)
    return tangent, np.cross(normals, tangent)
