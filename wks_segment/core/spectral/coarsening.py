"""A coarse space for smooth functions on a surface: cells of vertices, and local linear functions over them.

The low eigenfunctions vary slowly, so that a few values a wavelength tell them apart. The space need not be accurate,
only rich enough; inverse iteration on the surface itself does the rest (`spectrum`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import LinAlgError, cholesky
from scipy.sparse import coo_matrix, csr_matrix, diags, identity, vstack
from scipy.sparse.csgraph import connected_components

from ..mesh.triangle_mesh import FloatArray, IntArray, TriangleMesh
from .dense_eigen import lowest_eigenpairs, solved
from .laplacian import stiffness_matrix, unit_area_masses

HEAVIEST = 1.5
"""A cell of more than this many times the mean mass is split: on a thin limb, a cube of space holds a whole tube."""
LIGHTEST = 0.2
"""A cell of less than this many times the mean mass joins a neighbor, if it does not become too heavy."""
SPLITS = 5
"""Rounds of splitting, each into half the size."""
REACH, REACH_SMOOTHED, REACH_WIDE = 2.0, 1.8, 2.6
"""Radius of a cell's function, in square roots of a cell's mean area: plain, smoothed, and for a space that is solved
densely. Wider functions are more accurate and overlap more."""
MANY_VERTICES = 15
"""Vertices in a cell from which on functions need no smoothing: they are smooth on the scale of the triangles."""
DAMPING = np.float32(0.66)
"""Of a step of smoothing, in units of the inverse diagonal."""
LEAST_WEIGHT = 1e-3
"""Weight of a vertex's own cell if even its middle is out of reach."""
RIDGE = 1e-3
"""Decides what neighbors do not: across a flat surface, or where there are too few, a fit is constant."""
ROWS = 15_000
"""Vertices whose functions are fitted at once: their moments stay in the cache."""


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
    """Let light cells join the neighbor with which they share most edges."""
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


def coarse_eigenpairs(level: Level, n_zero: int, count: int) -> tuple[FloatArray, FloatArray]:
    """The lowest non-zero eigenpairs of a level that is small enough to be solved densely, at most `count`.

    Returns (k,) values and an (n, k) array of vectors in float32; the first `n_zero` pairs are left out.

    Raises
    ------
    scipy.linalg.LinAlgError
        If single precision does not suffice.
    """
    if not (np.isfinite(level.stiffness.data).all() and np.isfinite(level.mass.data).all()):
        raise LinAlgError("the coarse space has entries that are not finite")
    mass = level.mass.toarray()
    mass[np.diag_indices_from(mass)] *= 1 + np.finfo(np.float32).eps
    factor = cholesky(mass, lower=True)
    reduced = solved(factor, solved(factor, level.stiffness.toarray()).T)
    values, weights = lowest_eigenpairs((reduced + reduced.T) / 2, n_zero + count)
    vectors = solved(factor, weights[:, n_zero:], transposed=True)
    return values[n_zero:].astype(np.float64), np.ascontiguousarray(vectors)


@dataclass(frozen=True)
class Level:
    """The eigenproblem S x = λ M x on a surface, or restricted to the functions of its cells.

    Attributes
    ----------
    positions : (n, 3) array
        Of the vertices, or the vertices that stand for the cells, of a surface of area 1.
    edges : two (e,) int arrays
        The ends of what is adjacent.
    areas : (n,) array
        Area that belongs to each.
    stiffness, mass : (n, n) sparse matrices of float32
    """

    positions: FloatArray
    edges: tuple[IntArray, IntArray]
    areas: FloatArray
    stiffness: csr_matrix
    mass: csr_matrix

    @classmethod
    def of(cls, mesh: TriangleMesh) -> Level:
        """The finest level, of a mesh of area 1."""
        stiffness = csr_matrix(stiffness_matrix(mesh)).astype(np.float32)
        stiffness.sort_indices()
        masses = unit_area_masses(mesh)
        return cls(mesh.vertices, edges_of(stiffness), masses, stiffness, csr_matrix(diags(masses.astype(np.float32))))

    def zero_modes(self) -> FloatArray:
        """(n, c) M-orthonormal constants in float32, one for each component."""
        component, count = _components(*self.edges, len(self.areas))
        modes = np.zeros((len(component), count), dtype=np.float32)
        modes[np.arange(len(component)), component] = 1
        return np.asarray(
            modes / np.sqrt(np.einsum("ij,ij->j", modes, self.mass @ modes, dtype=np.float64)), np.float32
        )

    def coarsened(self, n_cells: int, wide: bool = False) -> tuple[csr_matrix, Level]:
        """Prolongation to this level from one of about `n_cells` cells, and that level (Galerkin's restriction).

        The prolongation is an (n, number of cells) sparse matrix: from values at cells to smooth functions. `wide` ones
        suit a space that is solved densely.
        """
        smoothed = wide or len(self.areas) < MANY_VERTICES * n_cells
        reach = REACH_WIDE if wide else REACH_SMOOTHED if smoothed else REACH
        cell, count = cluster(self.positions, self.edges, self.areas, n_cells)
        middle = _middle_vertices(self.positions, self.areas, cell, count)
        adjacent = _adjacency(cell, count, self.edges)
        around = csr_matrix(adjacent @ adjacent)
        blocks = [
            _moving_least_squares(
                self.positions[start : start + ROWS],
                cell[start : start + ROWS],
                self.positions[middle],
                around,
                reach / np.sqrt(n_cells),
            )
            for start in range(0, len(cell), ROWS)
        ]
        prolongation = csr_matrix(vstack(blocks, format="csr"))
        if smoothed:
            inverse_diagonal = 1 / np.maximum(self.stiffness.diagonal(), np.finfo(np.float32).tiny)
            prolongation = csr_matrix(
                prolongation - diags(DAMPING * inverse_diagonal) @ (self.stiffness @ prolongation)
            )
        restricted = [csr_matrix(prolongation.T @ (full @ prolongation)) for full in (self.stiffness, self.mass)]
        return prolongation, Level(
            self.positions[middle], edges_of(adjacent), _sums(self.areas, cell, count), *restricted
        )


def _moving_least_squares(
    positions: FloatArray, cell: IntArray, middles: FloatArray, around: csr_matrix, reach: float
) -> csr_matrix:
    """(len(positions), len(middles)) weights that carry values at the middles of cells to positions on the surface.

    Moving least squares (Lancaster and Salkauskas, 1981) over the cells `around` a position's own, with Wendland's
    weights: they sum to 1 and carry over functions that are linear in space.
    """
    row, column = _pairs(cell, around)
    across = (middles[column] - positions[row]) / reach
    distance = np.sqrt(np.einsum("ij,ij->i", across, across))
    weight = np.where(distance < 1, (1 - distance) ** 4 * (4 * distance + 1), 0.0)
    weight = np.where(column == cell[row], np.maximum(weight, LEAST_WEIGHT), weight)
    near = weight > 0
    row, column, weight = row[near], column[near], weight[near]
    x, y, z = across[near].T
    first = np.searchsorted(row, np.arange(len(positions) + 1))

    def moment(values: FloatArray) -> FloatArray:
        return np.asarray(np.add.reduceat(values, first[:-1]))

    # The constant term of the weighted fit of 1, x, y, z: the inverse of the 3 × 3 second moments by its adjugate.
    wx, wy, wz = weight * x, weight * y, weight * z
    w, mx, my, mz = moment(weight), moment(wx), moment(wy), moment(wz)
    ridge = RIDGE * w
    xx, yy, zz = moment(wx * x) + ridge, moment(wy * y) + ridge, moment(wz * z) + ridge
    xy, xz, yz = moment(wx * y), moment(wx * z), moment(wy * z)
    ixx, iyy, izz = yy * zz - yz * yz, xx * zz - xz * xz, xx * yy - xy * xy
    ixy, ixz, iyz = xz * yz - xy * zz, xy * yz - xz * yy, xy * xz - xx * yz
    determinant = xx * ixx + xy * ixy + xz * ixz
    slope_x = (ixx * mx + ixy * my + ixz * mz) / determinant
    slope_y = (ixy * mx + iyy * my + iyz * mz) / determinant
    slope_z = (ixz * mx + iyz * my + izz * mz) / determinant
    rest = w - slope_x * mx - slope_y * my - slope_z * mz
    values = (weight - slope_x[row] * wx - slope_y[row] * wy - slope_z[row] * wz) / rest[row]
    return csr_matrix((values.astype(np.float32), column, first), shape=(len(positions), len(middles)))


def _middle_vertices(positions: FloatArray, masses: FloatArray, cell: IntArray, count: int) -> IntArray:
    """(count,) the vertex of each cell that is nearest to its center of mass."""
    mass = _sums(masses, cell, count)
    center = np.stack([_sums(masses * x, cell, count) for x in positions.T], axis=1)
    away = ((positions - (center / mass[:, None])[cell]) ** 2).sum(axis=1)
    order = np.lexsort((away, cell))
    return order[np.searchsorted(cell[order], np.arange(count))]


def _adjacency(cell: IntArray, count: int, edges: tuple[IntArray, IntArray]) -> csr_matrix:
    """(count, count) matrix with an entry for each cell itself and for each that touches it."""
    a, b = cell[edges[0]], cell[edges[1]]
    touch = csr_matrix((np.ones(len(a), dtype=np.int32), (a, b)), shape=(count, count))
    return csr_matrix(csr_matrix(touch + touch.T + identity(count, dtype=np.int32, format="csr")) != 0)


def _pairs(cell: IntArray, adjacent: csr_matrix) -> tuple[IntArray, IntArray]:
    """Pairs of a vertex and a cell: its own, and those that touch its own."""
    size = np.diff(adjacent.indptr)[cell]
    start = np.repeat(adjacent.indptr[cell] - np.concatenate([[0], np.cumsum(size)[:-1]]), size)
    return np.repeat(np.arange(len(cell)), size), adjacent.indices[start + np.arange(size.sum())]
