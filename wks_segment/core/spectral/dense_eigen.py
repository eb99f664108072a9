"""Dense eigenproblems that let other threads run.

LAPACK's `ssyevr` is called by ctypes, without Python's lock, because no library call does what is needed. Measured on
1582 cells of a scanned person, 339 pairs, single precision (SciPy 1.15, one core):

    call                        CPU seconds   longest stop of another thread   same bits
    scipy.linalg.eigh           0.35          1.46 s: it holds the lock        yes
    numpy.linalg.eigh           1.19          0.02 s: it computes all pairs    no
    this module                 0.45          0.02 s                           –

With the lock held, poses would wait for each other, and Blender's window, whose thread needs the lock, would freeze.
"""

from __future__ import annotations

import ctypes
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import LowLevelCallable
from scipy.linalg import LinAlgError, cython_lapack, eigh, solve_triangular

from ..message import Message

ARGUMENTS, INTEGER_ARGUMENTS = 21, 11
"""Number of arguments of `ssyevr`, and of those that are pointers to integers."""
SOLVE_COLUMNS = 256
"""Columns of one triangular solve, during which SciPy holds Python's lock, so that it holds it briefly."""


def lowest_eigenpairs(matrix: NDArray[Any], count: int) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """The lowest `count` eigenpairs of a symmetric matrix in float32, or all if there are fewer.

    Returns
    -------
    (k,) values, rising, and (n, k) orthonormal vectors.

    Raises
    ------
    scipy.linalg.LinAlgError
        If an entry is not finite, or LAPACK fails.
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
    floats, integers = np.empty(1, dtype=np.float32), np.empty(1, dtype=np.int32)
    # Called with sizes of −1, it returns the sizes that its workspaces need.
    for sizes in ((-1, -1), (0, 0)):
        if sizes == (0, 0):
            floats, integers = np.empty(int(floats[0]), dtype=np.float32), np.empty(int(integers[0]), dtype=np.int32)
            sizes = len(floats), len(integers)
        n_found, info = ctypes.c_int(), ctypes.c_int()
        unused, tolerance = ctypes.c_float(), ctypes.c_float()
        syevr(
            *(ctypes.byref(ctypes.c_char(letter)) for letter in (b"V", b"I", b"L")),
            _int(n), a.ctypes, _int(n), ctypes.byref(unused), ctypes.byref(unused), _int(1), _int(count),
            ctypes.byref(tolerance), ctypes.byref(n_found), values.ctypes, vectors.ctypes, _int(n), support.ctypes,
            floats.ctypes, _int(sizes[0]), integers.ctypes, _int(sizes[1]), ctypes.byref(info),
        )  # fmt: skip
        if info.value:
            raise LinAlgError(Message("the dense eigensolver failed ({code})", code=info.value))
    return values[: n_found.value], vectors[:, : n_found.value]


def solve_lower_triangular(factor: NDArray[Any], right: NDArray[Any], transposed: bool = False) -> NDArray[Any]:
    """Solution X of L X = R, or of Lᵀ X = R, for a lower triangular L."""
    blocks = [right[:, start : start + SOLVE_COLUMNS] for start in range(0, right.shape[1], SOLVE_COLUMNS)]
    return np.hstack([solve_triangular(factor, block, lower=True, trans=int(transposed)) for block in blocks])


def _int(value: int) -> Any:
    return ctypes.byref(ctypes.c_int(value))


@cache
def _syevr() -> Any:
    """`ssyevr` of the LAPACK library that SciPy carries, as a ctypes function: called without Python's lock.

    None if SciPy was built with integers of 64 bits, as some distributions may do from version 1.18.
    """
    prototype = ctypes.PYFUNCTYPE(ctypes.c_void_p, ctypes.py_object, ctypes.c_char_p)
    signature = LowLevelCallable.from_cython(cython_lapack, "ssyevr").signature
    if signature.count(" int *") != INTEGER_ARGUMENTS:
        return None
    address = prototype(("PyCapsule_GetPointer", ctypes.pythonapi))(
        cython_lapack.__pyx_capi__["ssyevr"], signature.encode()
    )
    return ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * ARGUMENTS)(address)
