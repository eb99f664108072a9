"""Averages over the surface, by the flow of heat: the same on any meshing."""

from __future__ import annotations

from dataclasses import dataclass
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


class _Factor(Protocol):
    def solve(self, right: FloatArray) -> FloatArray: ...


@dataclass(frozen=True)
class HeatFlow:
    """One implicit step of heat flow, (M + t S) u' = M u with t = length², factored once for any number of functions.

    On a large surface it is taken on cells a fraction of the length wide.
    """

    mass: csr_matrix
    factor: _Factor
    prolongation: csr_matrix | None

    @classmethod
    def on(cls, mesh: TriangleMesh, length: float) -> HeatFlow:
        """Over about `length`, in units of the square root of the area."""
        unit = mesh.with_unit_area()
        level = Level.of(unit)
        mass, prolongation = level.mass, None
        if mesh.n_vertices > LARGE:
            prolongation, level = level.coarsened(max(round((CELLS_PER_LENGTH / length) ** 2), LEAST_CELLS))
            mass = csr_matrix(prolongation.T @ mass)
        system = csr_matrix(level.mass + np.float32(length**2) * level.stiffness)
        try:
            factor = NestedDissectionFactor(system, level.positions)
        except SingularError:
            factor = None
        if factor is None or factor.n_negative:
            # Slivers weigh so much more than areas that single precision loses these.
            masses = diags(unit_area_masses(unit))
            return cls(csr_matrix(masses), splu(csc_matrix(masses + length**2 * stiffness_matrix(unit))), None)
        return cls(mass, factor, prolongation)

    def smooth(self, values: FloatArray) -> FloatArray:
        """(n, k) values at vertices, averaged over the surface within about the length."""
        smooth = self.factor.solve(self.mass @ values.astype(self.mass.dtype))
        return np.asarray(smooth if self.prolongation is None else self.prolongation @ smooth)
