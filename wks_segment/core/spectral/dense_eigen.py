"""Dense eigenproblems that let other threads go on.

SciPy's own call of LAPACK keeps Python's lock until it is done: poses would wait for each other, and a window, whose
thread needs the lock too, would stand still. The same function of the same library is called without it here.
"""

from __future__ import annotations

import ctypes
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import LowLevelCallable
from scipy.linalg import LinAlgError, cython_lapack, eigh, solve_triangular

ARGUMENTS, WHOLE = 21, 11
"""Of syevr, and how many of them are whole numbers."""
COLUMNS = 256
"""Columns that are solved for at once, so that the lock is kept for a moment only."""


def lowest_eigenpairs(matrix: NDArray[Any], count: int) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """(k,) lowest eigenvalues and (n, k) eigenvectors of a symmetric matrix in float32, at most `count`.

    Raises
    ------
    scipy.linalg.LinAlgError
        If an entry is not finite, or LAPACK gives up.
    """
    if not np.isfinite(matrix).all():
        raise LinAlgError("the matrix has entries that are not finite")
    n, count, syevr = len(matrix), min(count, len(matrix)), _syevr()
    if syevr is None:
        values, vectors = eigh(matrix, subset_by_index=[0, count - 1])
        return values, vectors
    a = np.array(matrix, dtype=np.float32, order="F")
    values, vectors = np.empty(n, dtype=np.float32), np.empty((n, count), dtype=np.float32, order="F")
    support = np.empty(2 * n, dtype=np.int32)
    work, whole = np.empty(1, dtype=np.float32), np.empty(1, dtype=np.int32)
    # Asked with −1 for their sizes, it says how large its working arrays should be.
    for sizes in ((-1, -1), (0, 0)):
        if sizes == (0, 0):
            work, whole = np.empty(int(work[0]), dtype=np.float32), np.empty(int(whole[0]), dtype=np.int32)
            sizes = len(work), len(whole)
        found, info = ctypes.c_int(), ctypes.c_int()
        nothing, tolerance = ctypes.c_float(), ctypes.c_float()
        syevr(
            *(ctypes.byref(ctypes.c_char(letter)) for letter in (b"V", b"I", b"L")),
            _int(n), a.ctypes, _int(n), ctypes.byref(nothing), ctypes.byref(nothing), _int(1), _int(count),
            ctypes.byref(tolerance), ctypes.byref(found), values.ctypes, vectors.ctypes, _int(n), support.ctypes,
            work.ctypes, _int(sizes[0]), whole.ctypes, _int(sizes[1]), ctypes.byref(info),
        )  # fmt: skip
        if info.value:
            raise LinAlgError(f"the dense eigensolver failed ({info.value})")
    return values[: found.value], vectors[:, : found.value]


def solved(factor: NDArray[Any], right: NDArray[Any], transposed: bool = False) -> NDArray[Any]:
    """X of L X = R, or of Lᵀ X = R, for a lower triangular L."""
    panels = [right[:, begun : begun + COLUMNS] for begun in range(0, right.shape[1], COLUMNS)]
    return np.hstack([solve_triangular(factor, panel, lower=True, trans=int(transposed)) for panel in panels])


def _int(value: int) -> Any:
    return ctypes.byref(ctypes.c_int(value))


@cache
def _syevr() -> Any:
    """The function of LAPACK that SciPy carries, as ctypes calls it: without the lock.

    None where SciPy was built with whole numbers of 64 bits, as some distributions may from 1.18 on.
    """
    prototype = ctypes.PYFUNCTYPE(ctypes.c_void_p, ctypes.py_object, ctypes.c_char_p)
    signature = LowLevelCallable.from_cython(cython_lapack, "ssyevr").signature
    if signature.count(" int *") != WHOLE:
        return None
    address = prototype(("PyCapsule_GetPointer", ctypes.pythonapi))(
        cython_lapack.__pyx_capi__["ssyevr"], signature.encode()
    )
    return ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * ARGUMENTS)(address)
