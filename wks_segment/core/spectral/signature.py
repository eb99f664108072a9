"""Signatures of the points of a surface, made from its spectrum: the same in every pose that does not stretch it.

Wave Kernel Signature: Aubry, Schlickewei and Cremers, "The wave kernel signature: a quantum mechanical approach to
shape analysis" (2011). Heat Kernel Signature: Sun, Ovsjanikov and Guibas (2009).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from ..mesh.triangle_mesh import FloatArray, TriangleMesh
from ..message import Message
from ..progress import Progress
from ..threads import one_blas_thread
from .eigenpairs import Accuracy, Panels, eigenpair_panels

ZERO_EIGENVALUE = 1e-8
"""Fraction of the largest eigenvalue up to which an eigenvalue counts as zero: a function that is constant on an
island."""
BAND_WIDTH = 7.0
"""σ in steps of the energies, as in the paper."""
ENERGY_MARGIN = 1.02
"""The energies end at log(E_N) / 1.02, as in the paper."""
SIGNATURE_ROWS = 16_384
"""Vertices in one block: their squared eigenfunctions take 40 MB for 300 pairs in double precision."""


def wave_kernel_signature(values: ArrayLike, functions: ArrayLike, n_energies: int = 100) -> FloatArray:
    """Wave Kernel Signature of every vertex.

    WKS(x, e) = (1 / C_e) Σ_k exp(−(e − log E_k)² / 2σ²) φ_k(x)², with C_e = Σ_k exp(−(e − log E_k)² / 2σ²), at M
    equally spaced energies e from log E_1 to log(E_N) / 1.02, both included, σ = 7 (e_max − e_min) / M.
    The mean over the surface is 1 at every energy, if its area is 1.

    Parameters
    ----------
    values : (k,) array of float
        Eigenvalues of the surface scaled to area 1, rising. Zero modes are left out.
    functions : (n, k) array of float
        Eigenfunctions at the vertices, orthonormal under the mass matrix.
    n_energies : int
        M, the number of energies.

    Returns
    -------
    (n, M) array of float, in the precision of the functions.

    Raises
    ------
    ValueError
        If the shapes do not match, or fewer than two eigenvalues are above zero.

    Examples
    --------
    >>> from examples.tube import tube
    >>> from wks_segment.core import eigenpairs, wave_kernel_signature
    >>> wave_kernel_signature(*eigenpairs(tube(0.5), n_pairs=30), n_energies=10).shape
    (290, 10)
    """
    values, functions = _checked_pairs(values, functions)
    return _weighted_squares(_one_panel(functions), _energy_weights(values, n_energies), functions.shape[0])


@one_blas_thread
def wave_kernel_signature_of(
    mesh: TriangleMesh,
    n_pairs: int = 300,
    n_energies: int = 100,
    accuracy: Accuracy = "fast",
    progress: Callable[[float], None] | Progress | None = None,
) -> FloatArray:
    """`wave_kernel_signature` of the eigenpairs of a mesh, without holding all eigenfunctions in memory.

    For parameters and errors see `eigenpairs` and `wave_kernel_signature`.
    """
    values, place, panels = eigenpair_panels(mesh, n_pairs, accuracy, progress)
    return _weighted_squares(panels, _energy_weights(values, n_energies), mesh.n_vertices)[place]


def _energy_weights(values: FloatArray, n_energies: int) -> FloatArray:
    """(k, n_energies) weight of each eigenpair in the signature at each energy; 0 for zero modes."""
    if n_energies < 2:
        raise ValueError(Message("n_energies must be at least 2, not {value!r}", value=n_energies))
    kept = values > ZERO_EIGENVALUE * values.max()
    if kept.sum() < 2:
        raise ValueError(
            Message(
                "the signature needs two eigenvalues above zero; of {total} eigenvalues, {count} are",
                total=len(values),
                count=kept.sum(),
            )
        )
    logs = np.log(values[kept])
    # Of a negative logarithm, the paper's division by 1.02 would raise the end above log E_N.
    first, last = logs[0], min(logs[-1] / ENERGY_MARGIN, logs[-1])
    if last <= first:
        raise ValueError(
            Message(
                "the eigenvalues {first:.4g} to {last:.4g} span no energies: compute more pairs",
                first=values[kept][0],
                last=values[kept][-1],
            )
        )
    sigma = BAND_WIDTH * (last - first) / n_energies
    energies = np.linspace(first, last, n_energies)
    weights = np.zeros((len(values), n_energies))
    weights[kept] = np.exp(-((energies - logs[:, None]) ** 2) / (2 * sigma**2))
    return np.asarray(weights / weights.sum(axis=0))


def heat_kernel_signature(
    values: ArrayLike, functions: ArrayLike, n_times: int = 100, times: ArrayLike | None = None
) -> FloatArray:
    """Heat Kernel Signature of every vertex: HKS(x, t) = Σ_k exp(−E_k t) φ_k(x)².

    Parameters
    ----------
    values, functions
        See `wave_kernel_signature`; here zero modes are included.
    n_times : int
        Number of times, in equal logarithmic steps from 4 ln 10 / E_N to 4 ln 10 / E_1 (Sun et al.).
    times : (t,) array of float, optional
        Times to use instead.

    Returns
    -------
    (n, n_times) or (n, t) array of float.

    Raises
    ------
    ValueError
        If the shapes do not match, or no eigenvalue is above zero.

    Examples
    --------
    >>> from examples.tube import tube
    >>> from wks_segment.core import eigenpairs, heat_kernel_signature
    >>> heat_kernel_signature(*eigenpairs(tube(0.5), n_pairs=30), n_times=10).shape
    (290, 10)
    """
    values, functions = _checked_pairs(values, functions)
    if times is None:
        above = values[values > ZERO_EIGENVALUE * values.max()]
        if not above.size:
            raise ValueError("the signature needs an eigenvalue above zero")
        times = np.geomspace(4 * np.log(10) / above[-1], 4 * np.log(10) / above[0], n_times)
    weights = np.exp(-np.outer(values, np.asarray(times, dtype=np.float64)))
    return _weighted_squares(_one_panel(functions), weights, functions.shape[0])


def _checked_pairs(values: ArrayLike, functions: ArrayLike) -> tuple[FloatArray, FloatArray]:
    values, functions = np.asarray(values, dtype=np.float64), np.asarray(functions)
    if values.ndim != 1 or functions.ndim != 2 or functions.shape[1] != len(values) or not len(values):
        raise ValueError(
            Message(
                "values must have the shape (k,) and functions (n, k), not {values} and {functions}",
                values=values.shape,
                functions=functions.shape,
            )
        )
    if (np.diff(values) < 0).any():
        raise ValueError("the eigenvalues must rise")
    return values, functions


def _one_panel(functions: FloatArray) -> Panels:
    """All functions as one panel."""
    return iter([(slice(0, functions.shape[1]), functions)])


def _weighted_squares(panels: Panels, weights: FloatArray, n_vertices: int) -> FloatArray:
    """(n, M) product of the squared functions with (k, M) weights; panels are computed a block of rows at a time."""
    result: FloatArray | None = None
    for columns, panel in panels:
        panel_weights = weights[columns].astype(panel.dtype)  # single precision stays single
        if result is None:
            result = np.zeros((n_vertices, weights.shape[1]), dtype=panel.dtype)
        for start in range(0, n_vertices, SIGNATURE_ROWS):
            rows = slice(start, start + SIGNATURE_ROWS)
            result[rows] += panel[rows] ** 2 @ panel_weights
    assert result is not None
    return result
