"""Averages over the surface, by the flow of heat: the same on any meshing."""

from __future__ import annotations

from collections import OrderedDict
from typing import Protocol

import numpy as np
from scipy.sparse import csc_matrix, csr_matrix, diags
from scipy.sparse.linalg import splu

from .coarse import Level
from .factor import NestedDissectionFactor, SingularError
from .laplacian import stiffness_matrix, unit_area_masses
from .mesh import FloatArray, TriangleMesh

LARGE = 200_000
"""Vertices from which values are smoothed on cells."""
CELLS_PER_LENGTH = 2.0
"""Cells in a row along the smoothing length."""
LEAST_CELLS = 4_000
KEPT = 4
"""Flows of a mesh that are kept: of labels, of regions, of sides, and one more."""


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
    """

    def __init__(self, mesh: TriangleMesh, length: float) -> None:
        unit = mesh.with_unit_area()
        level = Level.of(unit)
        self._mass, self._prolongation = level.mass, None
        if len(level.areas) > LARGE:
            cells = max(round((CELLS_PER_LENGTH / length) ** 2), LEAST_CELLS)
            self._prolongation, level = level.coarsened(cells)
            self._mass = csr_matrix(self._prolongation.T @ self._mass)
        system = csr_matrix(level.mass + np.float32(length**2) * level.stiffness)
        factor: NestedDissectionFactor | None
        try:
            factor = NestedDissectionFactor(system, level.positions)
        except SingularError:
            factor = None
        if factor is not None and not factor.n_negative:
            self._factor: _Factor = factor
        else:
            # Slivers weigh so much more than areas that single precision loses these.
            masses = diags(unit_area_masses(unit))
            self._mass, self._prolongation = csr_matrix(masses), None
            self._factor = splu(csc_matrix(masses + length**2 * stiffness_matrix(unit)))

    def smooth(self, values: FloatArray) -> FloatArray:
        """(n, k) values at vertices, averaged over the surface within about the length."""
        smooth = self._factor.solve(self._mass @ values.astype(self._mass.dtype))
        return np.asarray(smooth if self._prolongation is None else self._prolongation @ smooth)


class Flows:
    """The heat flows of one mesh by length, each factored once; the last few are kept."""

    def __init__(self, mesh: TriangleMesh) -> None:
        self._mesh = mesh
        self._kept: OrderedDict[float, HeatFlow] = OrderedDict()

    def over(self, length: float) -> HeatFlow:
        """The flow over a length."""
        if length not in self._kept:
            self._kept[length] = HeatFlow(self._mesh, length)
        self._kept.move_to_end(length)
        while len(self._kept) > KEPT:
            self._kept.popitem(last=False)
        return self._kept[length]
