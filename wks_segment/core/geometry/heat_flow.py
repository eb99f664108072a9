"""Averages over the surface, by the flow of heat: the same on any meshing."""

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
from ..spectral.multifrontal import Dissection, NestedDissectionFactor, SingularError, nested_dissection

LARGE = 200_000
"""Vertices from which values are smoothed on cells."""
CELLS_PER_LENGTH = 2.0
"""Cells in a row along the smoothing length."""
LEAST_CELLS = 4_000
KEPT, MOST_VERTICES = 5, 60_000
"""Flows that are kept, of a mesh of up to so many vertices: one takes five megabytes for 10,000."""


class _Factor(Protocol):
    def solve(self, right: FloatArray) -> FloatArray: ...


class HeatFlow:
    """One implicit step of heat flow, (M + t S) u' = M u with t = length².

    Factored once, for any number of functions; on a large surface on cells a fraction of the length wide.

    Parameters
    ----------
    mesh : TriangleMesh
    length : float
        Over about which values are averaged, in units of the square root of the area.
    ground : optional
        `_Ground(mesh)`, where it is there already.
    """

    def __init__(self, mesh: TriangleMesh, length: float, ground: _Ground | None = None) -> None:
        ground = ground or _Ground(mesh)
        level, dissection = ground.level, None
        self._mass, self._prolongation = level.mass, None
        if len(level.areas) > LARGE:
            cells = max(round((CELLS_PER_LENGTH / length) ** 2), LEAST_CELLS)
            self._prolongation, level = level.coarsened(cells)
            self._mass = csr_matrix(self._prolongation.T @ self._mass)
        else:
            dissection = ground.dissection
        system = _system(level, length)
        factor: NestedDissectionFactor | None
        try:
            factor = NestedDissectionFactor(system, level.positions, dissection=dissection)
        except SingularError:
            factor = None
        if factor is not None and not factor.n_negative:
            self._factor: _Factor = factor
        else:
            # Slivers weigh so much more than areas that single precision loses these.
            masses = diags(unit_area_masses(ground.unit))
            self._mass, self._prolongation = csr_matrix(masses), None
            self._factor = splu(csc_matrix(masses + length**2 * stiffness_matrix(ground.unit)))

    def smooth(self, values: FloatArray) -> FloatArray:
        """(n, k) values at vertices, averaged over the surface within about the length."""
        smooth = self._factor.solve(self._mass @ values.astype(self._mass.dtype))
        return np.asarray(smooth if self._prolongation is None else self._prolongation @ smooth)


class Flows:
    """The heat flows of one mesh by length, each factored once; the last few are kept, unless the mesh is large."""

    def __init__(self, mesh: TriangleMesh) -> None:
        self._mesh = mesh
        self._ground: _Ground | None = None
        self._kept: OrderedDict[float, HeatFlow] = OrderedDict()

    def over(self, length: float) -> HeatFlow:
        """The flow over a length."""
        if length in self._kept:
            self._kept.move_to_end(length)
            return self._kept[length]
        if self._mesh.n_vertices > MOST_VERTICES:
            return HeatFlow(self._mesh, length)
        self._ground = self._ground or _Ground(self._mesh)
        self._kept[length] = HeatFlow(self._mesh, length, self._ground)
        if len(self._kept) > KEPT:
            self._kept.popitem(last=False)
        return self._kept[length]


class _Ground:
    """What flows over all lengths have in common."""

    def __init__(self, mesh: TriangleMesh) -> None:
        self.unit = mesh.with_unit_area()
        self.level = Level.of(self.unit)

    @cached_property
    def dissection(self) -> Dissection:
        """Of the system that a flow solves: its entries are at the same places for every length."""
        return nested_dissection(_system(self.level, 1.0), self.level.positions)


def _system(level: Level, length: float) -> csr_matrix:
    return csr_matrix(level.mass + np.float32(length**2) * level.stiffness)
