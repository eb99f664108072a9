"""Averages over the surface by heat flow, which do not depend on the meshing."""

from __future__ import annotations

from collections import OrderedDict
from functools import cached_property
from typing import Protocol

import numpy as np
from scipy.sparse import csc_matrix, csr_matrix, diags
from scipy.sparse.linalg import splu

from ..mesh.triangle_mesh import FloatArray, TriangleMesh
from ..spectral.coarsening import Level
from ..spectral.laplacian import stiffness_matrix, unit_area_masses
from ..spectral.multifrontal import Dissection, MultifrontalFactor, SingularError, nested_dissection

CELLS_ABOVE = 200_000
"""Number of vertices above which values are smoothed on cells: a factor grows faster than the mesh."""
CELLS_PER_LENGTH = 2.0
"""Cells in a row along the smoothing length."""
LEAST_CELLS = 4_000
"""Least number of cells, for long smoothing lengths."""
FLOWS_KEPT, FLOWS_KEPT_UP_TO = 5, 60_000
"""Number of flows that are kept, for a mesh of up to so many vertices: a flow takes 5 MB for 10,000 vertices."""

ACCURACY, MOST_STEPS = 1e-4, 100
"""Relative residual at which conjugate gradients end, and most steps; ten are usual."""


class _Factor(Protocol):
    def solve(self, right: FloatArray) -> FloatArray: ...


class HeatFlow:
    """One implicit step of heat flow, (M + t S) u' = M u with t = length².

    The system is factored once, for any number of functions; on a large surface it is solved on cells that are a
    fraction of the length wide.

    Parameters
    ----------
    mesh : TriangleMesh
    length : float
        Length over which values are averaged, in units of the square root of the area.
    system : optional
        `FlowSystem(mesh)`, if it exists already.
    """

    def __init__(self, mesh: TriangleMesh, length: float, system: FlowSystem | None = None) -> None:
        system = system or FlowSystem(mesh)
        level, dissection = system.level, None
        self._mass, self._prolongation = level.mass, None
        if len(level.areas) > CELLS_ABOVE:
            cells = max(round((CELLS_PER_LENGTH / length) ** 2), LEAST_CELLS)
            self._prolongation, level = level.coarsened(cells)
            self._mass = csr_matrix(self._prolongation.T @ self._mass)
        else:
            dissection = system.dissection
        factor: MultifrontalFactor | None
        try:
            factor = MultifrontalFactor(_matrix(level, length), level.positions, dissection=dissection)
        except SingularError:
            factor = None
        if factor is not None and not factor.n_negative:
            self._factor: _Factor = factor
        else:
            # Next to the weights of slivers, the areas are lost in single precision.
            masses = diags(system.masses)
            self._mass, self._prolongation = csr_matrix(masses), None
            self._factor = splu(csc_matrix(masses + length**2 * system.stiffness))

    def smooth(self, values: FloatArray) -> FloatArray:
        """(n, k) values at vertices, averaged over the surface within about the length."""
        smooth = self._factor.solve(self._mass @ values.astype(self._mass.dtype))
        return np.asarray(smooth if self._prolongation is None else self._prolongation @ smooth)


class ShortFlow:
    """The same step over a length of a few edges, for few functions: without a factor, by conjugate gradients.

    Parameters
    ----------
    system : FlowSystem
    length : float
        As for `HeatFlow`.
    """

    def __init__(self, system: FlowSystem, length: float) -> None:
        self._masses = system.masses
        self._matrix = csr_matrix(diags(self._masses) + length**2 * system.stiffness)
        self._diagonal = self._matrix.diagonal()

    def smooth(self, values: FloatArray) -> FloatArray:
        """(n, k) values at vertices, averaged over the surface within about the length."""
        result = values.astype(np.float64)
        residual = self._masses[:, None] * result - self._matrix @ result
        scaled = residual / self._diagonal[:, None]
        direction, norm = scaled, np.einsum("nk,nk->k", residual, scaled)
        enough = ACCURACY**2 * np.einsum("nk,nk->k", self._masses[:, None] * result, result)
        for _ in range(MOST_STEPS):
            if (norm <= enough).all():
                break
            image = self._matrix @ direction
            # A function that has converged has a direction of length 0 and stays as it is.
            step = norm / np.maximum(np.einsum("nk,nk->k", direction, image), np.finfo(float).tiny)
            result = result + step * direction
            residual = residual - step * image
            scaled, before = residual / self._diagonal[:, None], norm
            norm = np.einsum("nk,nk->k", residual, scaled)
            direction = scaled + norm / np.maximum(before, np.finfo(float).tiny) * direction
        return np.asarray(result)


class Flows:
    """Heat flows of one mesh by length, each factored once; the last few are kept, unless the mesh is large."""

    def __init__(self, mesh: TriangleMesh) -> None:
        self._mesh = mesh
        self._system: FlowSystem | None = None
        self._flows: OrderedDict[float, HeatFlow] = OrderedDict()

    def over(self, length: float) -> HeatFlow:
        """Flow that averages over a length."""
        if length in self._flows:
            self._flows.move_to_end(length)
            return self._flows[length]
        if self._mesh.n_vertices > FLOWS_KEPT_UP_TO:
            return HeatFlow(self._mesh, length)
        self._system = self._system or FlowSystem(self._mesh)
        self._flows[length] = HeatFlow(self._mesh, length, self._system)
        if len(self._flows) > FLOWS_KEPT:
            self._flows.popitem(last=False)
        return self._flows[length]

    def short(self, length: float) -> ShortFlow:
        """Flow that averages few functions over a length of a few edges."""
        self._system = self._system or FlowSystem(self._mesh)
        return ShortFlow(self._system, length)


class FlowSystem:
    """Matrices and elimination order that the flows of one mesh over all lengths share."""

    def __init__(self, mesh: TriangleMesh) -> None:
        self.unit_mesh = mesh.with_unit_area()

    @cached_property
    def level(self) -> Level:
        """The surface with its matrices in single precision."""
        return Level.of(self.unit_mesh)

    @cached_property
    def masses(self) -> FloatArray:
        """(n,) area of each vertex."""
        return unit_area_masses(self.unit_mesh)

    @cached_property
    def stiffness(self) -> csr_matrix:
        """(n, n) cotangent matrix."""
        return csr_matrix(stiffness_matrix(self.unit_mesh))

    @cached_property
    def dissection(self) -> Dissection:
        """Elimination order: the matrix has entries at the same positions for every length."""
        return nested_dissection(_matrix(self.level, 1.0), self.level.positions)


def _matrix(level: Level, length: float) -> csr_matrix:
    """M + length² S."""
    return csr_matrix(level.mass + np.float32(length**2) * level.stiffness)
