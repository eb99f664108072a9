"""Coarse space of smooth functions on a surface: cells of vertices, and locally linear functions over the cells.

The low eigenfunctions vary slowly, so that a few values per wavelength describe them. The space need not be accurate,
only rich enough; inverse iteration on the surface does the rest (`multilevel`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import LinAlgError, cholesky
from scipy.sparse import coo_matrix, csr_matrix, diags, identity, vstack

from ..mesh.triangle_mesh import FloatArray, IntArray, TriangleMesh, connected_groups
from .dense_eigen import lowest_eigenpairs, solve_lower_triangular
from .laplacian import stiffness_matrix, unit_area_masses

HEAVIEST_CELL = 1.5
"""Mass of a cell, in units of the mean, above which it is split: on a thin limb, a cube holds a whole tube."""
LIGHTEST_CELL = 0.2
"""Mass of a cell, in units of the mean, below which it joins a neighbor, unless that becomes too heavy."""
MAX_SPLITS = 5
"""Most rounds of splitting, each into cubes of half the size."""
REACH_PLAIN, REACH_SMOOTHED, REACH_WIDE = 2.0, 1.8, 2.6
"""Radius of the function of a cell, in units of the square root of a cell's mean area: plain, smoothed, and for a space
that is solved densely. Wider functions are more accurate and overlap more."""
MANY_PER_CELL = 15
"""Vertices per cell from which functions need no smoothing: they are smooth on the scale of the triangles."""
SMOOTHING_DAMPING = np.float32(0.66)
"""Length of a smoothing step, in units of the inverse diagonal."""
LEAST_OWN_WEIGHT = 1e-3
"""Least weight of a vertex's own cell, for a vertex that its function does not reach."""
RIDGE = 1e-3
"""Regularization of a fit, relative to its weights: in directions in which its cells do not extend, it is constant."""
FIT_ROWS = 15_000
"""Vertices whose functions are fitted at once, so that their moments fit the cache."""


def graph_edges(matrix: csr_matrix) -> tuple[IntArray, IntArray]:
    """The two ends of each edge in the graph of a symmetric sparse matrix."""
    entries = matrix.tocoo()
    once = entries.row < entries.col
    return entries.row[once], entries.col[once]


def cluster_vertices(
    positions: FloatArray, edges: tuple[IntArray, IntArray], masses: FloatArray, n_cells: int
) -> tuple[IntArray, int]:
    """(n,) cell of each vertex, and their number: about `n_cells` connected cells, none of them much too heavy.

    Cells are the connected parts of the surface within cubes of space; cells that are too heavy are split again by
    cubes of half the size.
    """
    first, second = edges
    mean = masses.sum() / n_cells
    size = np.sqrt(mean)
    cell = np.zeros(len(positions), dtype=np.int64)
    too_heavy = np.ones(len(positions), dtype=bool)
    corner = positions.min(axis=0)
    for _ in range(MAX_SPLITS):
        cube = np.floor((positions - corner) / size).astype(np.int64)
        cube -= cube.min(axis=0)
        spans = cube.max(axis=0) + 1
        number = (cube[:, 0] * spans[1] + cube[:, 1]) * spans[2] + cube[:, 2]
        together = (cell[first] == cell[second]) & (
            (number[first] == number[second]) | ~(too_heavy[first] & too_heavy[second])
        )
        cell = connected_groups(np.stack([first[together], second[together]], axis=1), len(positions))
        count = int(cell.max()) + 1
        mass = _sums(masses, cell, count)
        too_heavy = mass[cell] > HEAVIEST_CELL * mean
        if not too_heavy.any():
            break
        size /= 2
    return _join_light_cells(cell, edges, mass, mean)


def _sums(values: FloatArray, owner: IntArray, count: int) -> FloatArray:
    """(count,) sums of values by owner."""
    return np.bincount(owner, weights=values, minlength=count).astype(np.float64)


def _join_light_cells(
    cell: IntArray, edges: tuple[IntArray, IntArray], mass: FloatArray, mean: float
) -> tuple[IntArray, int]:
    """(n,) cell of each vertex, after light cells have joined the neighbor with which they share most edges."""
    a, b = cell[edges[0]], cell[edges[1]]
    a, b = np.concatenate([a, b]), np.concatenate([b, a])
    light = mass < LIGHTEST_CELL * mean
    fits = light[a] & ~light[b] & (mass[a] + mass[b] < HEAVIEST_CELL * mean) & (a != b)
    shared = coo_matrix((np.ones(fits.sum()), (a[fits], b[fits])), shape=(len(mass),) * 2).tocsr()
    target = np.arange(len(mass))
    joins = np.diff(shared.indptr) > 0
    if joins.any():
        target[joins] = np.asarray(shared.argmax(axis=1)).ravel()[joins]
    kept, result = np.unique(target[cell], return_inverse=True)
    return result.astype(np.int64), len(kept)


def coarse_eigenpairs(level: Level, n_zero: int, count: int) -> tuple[FloatArray, FloatArray]:
    """The lowest non-zero eigenpairs, at most `count`, of a level that is small enough to be solved densely.

    Parameters
    ----------
    level : Level
        With n cells.
    n_zero : int
        Number of zero modes, which are left out.
    count : int

    Returns
    -------
    (k,) values, rising, and (n, k) vectors in float32.

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
    reduced = solve_lower_triangular(factor, solve_lower_triangular(factor, level.stiffness.toarray()).T)
    values, weights = lowest_eigenpairs((reduced + reduced.T) / 2, n_zero + count)
    vectors = solve_lower_triangular(factor, weights[:, n_zero:], transposed=True)
    return values[n_zero:].astype(np.float64), np.ascontiguousarray(vectors)


@dataclass(frozen=True)
class Level:
    """The eigenproblem S x = λ M x on a surface of area 1, or restricted to the functions of its cells.

    Attributes
    ----------
    positions : (n, 3) array
        Positions of the vertices, or of the vertex in the middle of each cell.
    edges : two (e,) int arrays
        The ends of the edges between vertices, or between neighboring cells.
    areas : (n,) array
        Area of each vertex or cell.
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
        mass = csr_matrix(diags(masses.astype(np.float32)))
        return cls(mesh.vertices, graph_edges(stiffness), masses, stiffness, mass)

    @property
    def is_surface(self) -> bool:
        """Whether this is the finest level, whose mass matrix is diagonal."""
        return bool(self.mass.nnz == len(self.areas))

    def in_double_precision(self) -> Level:
        """The same level in float64; rows of S sum to 0, from which rounding to float32 had moved them."""
        stiffness = self.stiffness.astype(np.float64)
        stiffness = csr_matrix(stiffness - diags(np.asarray(stiffness.sum(axis=1)).ravel()))
        return replace(self, stiffness=stiffness, mass=self.mass.astype(np.float64))

    def zero_modes(self) -> FloatArray:
        """(n, c) M-orthonormal constants in float32, one for each of c islands."""
        island = connected_groups(np.stack(self.edges, axis=1), len(self.areas))
        modes = np.zeros((len(island), int(island.max()) + 1), dtype=np.float32)
        modes[np.arange(len(island)), island] = 1
        return np.asarray(
            modes / np.sqrt(np.einsum("ij,ij->j", modes, self.mass @ modes, dtype=np.float64)), np.float32
        )

    def coarsened(self, n_cells: int, wide: bool = False) -> tuple[csr_matrix, Level]:
        """Prolongation from a level of about `n_cells` cells to this one, and that level (Galerkin's restriction).

        The prolongation is an (n, number of cells) sparse matrix that makes smooth functions from values at cells;
        `wide` functions suit a space that is solved densely.
        """
        smoothed = wide or len(self.areas) < MANY_PER_CELL * n_cells
        reach = REACH_WIDE if wide else REACH_SMOOTHED if smoothed else REACH_PLAIN
        prolongation, cell, middle, adjacent = self._functions_over_cells(n_cells, reach)
        if smoothed:
            inverse_diagonal = 1 / np.maximum(self.stiffness.diagonal(), np.finfo(np.float32).tiny)
            prolongation = csr_matrix(
                prolongation - diags(SMOOTHING_DAMPING * inverse_diagonal) @ (self.stiffness @ prolongation)
            )
        restricted = [csr_matrix(prolongation.T @ (full @ prolongation)) for full in (self.stiffness, self.mass)]
        return prolongation, Level(
            self.positions[middle], graph_edges(adjacent), _sums(self.areas, cell, len(middle)), *restricted
        )

    def functions_over_cells(self, n_cells: int) -> csr_matrix:
        """(n, number of cells) sparse matrix of functions over about `n_cells` cells, as `coarsened` begins with."""
        return self._functions_over_cells(n_cells, REACH_PLAIN)[0]

    def _functions_over_cells(self, n_cells: int, reach: float) -> tuple[csr_matrix, IntArray, IntArray, csr_matrix]:
        """Functions of cells that sum to 1; the cell of each vertex, the vertex in the middle of each, neighbors."""
        cell, count = cluster_vertices(self.positions, self.edges, self.areas, n_cells)
        middle = _middle_vertices(self.positions, self.areas, cell, count)
        adjacent = _adjacency(cell, count, self.edges)
        around = csr_matrix(adjacent @ adjacent)
        blocks = [
            _moving_least_squares(
                self.positions[start : start + FIT_ROWS],
                cell[start : start + FIT_ROWS],
                self.positions[middle],
                around,
                reach / np.sqrt(n_cells),
            )
            for start in range(0, len(cell), FIT_ROWS)
        ]
        return csr_matrix(vstack(blocks, format="csr")), cell, middle, adjacent


def _moving_least_squares(
    positions: FloatArray, cell: IntArray, middles: FloatArray, around: csr_matrix, reach: float
) -> csr_matrix:
    """(len(positions), len(middles)) sparse weights that interpolate values at the middles of cells at positions.

    Moving least squares (Lancaster and Salkauskas, 1981) over the cells `around` the cell of a position, with
    Wendland's weights: they sum to 1 and reproduce functions that are linear in space.
    """
    row, column = _vertex_cell_pairs(cell, around)
    across = (middles[column] - positions[row]) / reach
    distance = np.sqrt(np.einsum("ij,ij->i", across, across))
    weight = np.where(distance < 1, (1 - distance) ** 4 * (4 * distance + 1), 0.0)
    weight = np.where(column == cell[row], np.maximum(weight, LEAST_OWN_WEIGHT), weight)
    near = weight > 0
    row, column, weight = row[near], column[near], weight[near]
    x, y, z = across[near].T
    first = np.searchsorted(row, np.arange(len(positions) + 1))

    def moment(values: FloatArray) -> FloatArray:
        return np.asarray(np.add.reduceat(values, first[:-1]))

    # Constant term of the weighted fit of 1, x, y, z; the 3 × 3 second moments are inverted by the adjugate.
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
    """(count,) vertex of each cell that is nearest to its center of mass."""
    mass = _sums(masses, cell, count)
    center = np.stack([_sums(masses * x, cell, count) for x in positions.T], axis=1)
    away = ((positions - (center / mass[:, None])[cell]) ** 2).sum(axis=1)
    order = np.lexsort((away, cell))
    return order[np.searchsorted(cell[order], np.arange(count))]


def _adjacency(cell: IntArray, count: int, edges: tuple[IntArray, IntArray]) -> csr_matrix:
    """(count, count) matrix with an entry for each cell and itself, and for each pair of neighboring cells."""
    a, b = cell[edges[0]], cell[edges[1]]
    touch = csr_matrix((np.ones(len(a), dtype=np.int32), (a, b)), shape=(count, count))
    return csr_matrix(csr_matrix(touch + touch.T + identity(count, dtype=np.int32, format="csr")) != 0)


def _vertex_cell_pairs(cell: IntArray, adjacent: csr_matrix) -> tuple[IntArray, IntArray]:
    """Pairs of a vertex and a cell: its own cell, and those adjacent to it."""
    size = np.diff(adjacent.indptr)[cell]
    start = np.repeat(adjacent.indptr[cell] - np.concatenate([[0], np.cumsum(size)[:-1]]), size)
    return np.repeat(np.arange(len(cell)), size), adjacent.indices[start + np.arange(size.sum())]
