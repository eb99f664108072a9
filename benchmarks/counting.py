"""Counts of expensive operations by stage, for `benchmarks.guard`: unlike seconds, the same on a busy machine.

While a `Counter` is active, each counted function is replaced by one that counts its calls and their size, wherever a
module of the package has imported it; afterward all is as before. The package itself knows nothing of it.
"""

from __future__ import annotations

import functools
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from importlib import import_module
from types import FrameType
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

PACKAGE = "wks_segment"
OUTSIDE = "outside of stages"
"""Stage of what is counted outside of all stages."""
PYTHON_CALLS = "calls of Python functions"
"""What is counted besides the operations: calls of the package's own functions, which show loops in Python."""

Counts = dict[str, dict[str, int]]
"""For each stage, the number of each thing that was counted."""


@dataclass(frozen=True)
class Operation:
    """An expensive operation: a function of a module, or a method of a class.

    Attributes
    ----------
    name : str
        What its calls are called in the table.
    module : str
        Module that has the function or class.
    path : str
        Name of the function, or of the class and the method.
    unit : str
        What the size of a call counts.
    size : callable
        Size of a call, given its arguments.
    """

    name: str
    module: str
    path: str
    unit: str
    size: Callable[..., int]


def _cubes(matrix: Any, *_: Any) -> int:
    return int(np.prod(np.shape(matrix)) * np.shape(matrix)[-1])


def _unknowns(_: Any, matrix: Any, *others: Any) -> int:
    return int(matrix.shape[0])


def _numbers(_: Any, array: Any, *others: Any) -> int:
    return int(array.size)


OPERATIONS = (
    Operation("surfaces", "wks_segment.core.mesh.surface", "prepare_surface", "faces", lambda m, *_: m.n_faces),
    Operation("Delaunay rounds", "wks_segment.core.spectral.intrinsic_delaunay", "_Triangulation.flipped", "flips",
              _numbers),
    Operation("Laplacians", "wks_segment.core.spectral.laplacian", "stiffness_matrix", "faces", lambda m: m.n_faces),
    Operation("coarse levels", "wks_segment.core.spectral.coarsening", "Level.coarsened", "vertices",
              lambda level, *_: len(level.areas)),
    Operation("factorizations", "wks_segment.core.spectral.multifrontal", "MultifrontalFactor.__init__", "unknowns",
              _unknowns),
    Operation("solves", "wks_segment.core.spectral.multifrontal", "MultifrontalFactor.solve", "numbers", _numbers),
    Operation("compressions", "wks_segment.core.spectral.multifrontal", "MultifrontalFactor.compressed", "entries",
              lambda _, right: right.nnz),
    Operation("SuperLU factorizations", "scipy.sparse.linalg", "splu", "unknowns", lambda m, *_: m.shape[0]),
    Operation("corrections", "wks_segment.core.spectral.multilevel", "_Correction.change", "numbers",
              lambda _, values, vectors: vectors.size),
    Operation("dense eigenproblems (ssyevr)", "wks_segment.core.spectral.dense_eigen", "lowest_eigenpairs", "n³",
              _cubes),
    Operation("dense eigenproblems (SciPy)", "scipy.linalg", "eigh", "n³", _cubes),
    Operation("dense eigenproblems (NumPy)", "numpy.linalg", "eigh", "n³", _cubes),
    Operation("dense Cholesky factors", "scipy.linalg", "cholesky", "n³", _cubes),
    Operation("QR factorizations", "numpy.linalg", "qr", "numbers", lambda matrix, *_: np.size(matrix)),
    Operation("triangular solves", "scipy.linalg", "solve_triangular", "n² k", lambda a, b, *_: len(a) * np.size(b)),
    Operation("heat-flow factorizations", "wks_segment.core.geometry.heat_flow", "HeatFlow.__init__", "vertices",
              lambda _, mesh, *others: mesh.n_vertices),
    Operation("heat flows", "wks_segment.core.geometry.heat_flow", "HeatFlow.smooth", "numbers", _numbers),
    Operation("short heat flows", "wks_segment.core.geometry.heat_flow", "ShortFlow.smooth", "numbers", _numbers),
    Operation("motion of edges", "wks_segment.core.parts.motion", "edge_correlations", "faces",
              lambda poses, *_: sum(pose.n_faces for pose in poses)),
    Operation("shortest paths", "scipy.sparse.csgraph", "dijkstra", "edges", lambda graph, *_: graph.nnz),
    Operation("graph cuts", "scipy.sparse.csgraph", "maximum_flow", "edges", lambda graph, *_: graph.nnz),
    Operation("cluster trees", "scipy.cluster.hierarchy", "linkage", "numbers", lambda places, *_: np.size(places)),
    Operation("assignments", "scipy.optimize", "linear_sum_assignment", "costs", lambda costs, *_: np.size(costs)),
    Operation("k-means rounds", "wks_segment.core.learning.k_means", "_nearest", "distances",
              lambda places, centers: len(places) * len(centers)),
    Operation("M-steps", "wks_segment.core.learning.gaussian_mixture", "Moments.of", "numbers",
              lambda _, samples, squares, masses, *others: masses.size),
    Operation("densities", "wks_segment.core.learning.gaussian_mixture", "_log_gaussians", "numbers",
              lambda samples, squares, means, *_: len(samples) * means.size),
)  # fmt: skip
"""What is counted, besides kd-trees, whose class cannot be changed, and calls of Python functions."""


class Counter:
    """Counts operations by stage.

        with Counter() as counter, counter.stage("mixture"):
            model.fit(poses)
        print(counter.counts)

    Parameters
    ----------
    operations : sequence of Operation

    Attributes
    ----------
    counts : Counts
        For each operation its calls, and under "operation: unit" the sum of their sizes.
    """

    def __init__(self, operations: Sequence[Operation] = OPERATIONS) -> None:
        self.counts: Counts = {}
        self._operations = operations
        self._stage = OUTSIDE
        self._lock = threading.Lock()  # poses are described by threads
        self._stack = ExitStack()

    def __enter__(self) -> Counter:
        with ExitStack() as stack:
            for operation in self._operations:
                stack.enter_context(self._replaced(operation))
            stack.enter_context(_everywhere(cKDTree, self._counting_tree()))
            stack.callback(sys.setprofile, sys.getprofile())
            stack.callback(threading.setprofile, threading.getprofile())
            threading.setprofile(self._on_event)
            sys.setprofile(self._on_event)
            self._stack = stack.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Count what the block does under a stage; a stage inside of another one counts by itself."""
        outer, self._stage = self._stage, name
        try:
            yield
        finally:
            self._stage = outer

    def add(self, name: str, unit: str, size: int) -> None:
        """Count one call of an operation in the current stage."""
        self._add(**{name: 1, f"{name}: {unit}": int(size)})

    def _add(self, **numbers: int) -> None:
        with self._lock:
            of_stage = self.counts.setdefault(self._stage, {})
            for name, number in numbers.items():
                of_stage[name] = of_stage.get(name, 0) + number

    def _counting(self, function: Callable[..., Any], operation: Operation) -> Callable[..., Any]:
        """The function, which counts its calls."""

        @functools.wraps(function)
        def counted(*arguments: Any, **options: Any) -> Any:
            self.add(operation.name, operation.unit, operation.size(*arguments))
            return function(*arguments, **options)

        return counted

    @contextmanager
    def _replaced(self, operation: Operation) -> Iterator[None]:
        """The operation counts in this block; AttributeError if its module no longer has it."""
        *classes, name = operation.path.split(".")
        owner: Any = import_module(operation.module)
        for part in classes:
            owner = getattr(owner, part)
        function = vars(owner)[name] if name in vars(owner) else getattr(owner, name)
        if not classes:
            with _everywhere(function, self._counting(function, operation), owner):
                yield
            return
        counted: Any = (
            classmethod(self._counting(function.__func__, operation))
            if isinstance(function, classmethod)
            else self._counting(function, operation)
        )
        setattr(owner, name, counted)
        try:
            yield
        finally:
            setattr(owner, name, function)

    def _counting_tree(self) -> type[Any]:
        """A kd-tree that counts the points that it is built of and asked for."""
        add = self.add

        class CountingTree(cKDTree):  # type: ignore[misc]  # SciPy has no types
            def __init__(self, data: Any, *arguments: Any, **options: Any) -> None:
                add("kd-trees", "points", len(data))
                super().__init__(data, *arguments, **options)

            def query(self, x: Any, *arguments: Any, **options: Any) -> Any:
                add("kd-tree queries", "points", np.size(x) // self.m)
                return super().query(x, *arguments, **options)

        return CountingTree

    def _on_event(self, frame: FrameType, event: str, _: Any) -> None:
        """Called by Python for each call."""
        if event == "call" and frame.f_globals.get("__name__", "").startswith(PACKAGE):
            self._add(**{PYTHON_CALLS: 1})


@contextmanager
def _everywhere(before: Any, now: Any, *owners: Any) -> Iterator[None]:
    """A function or class is replaced in modules that own it, and in all of the package that have imported it."""

    def replace(old: Any, new: Any) -> None:
        of_package = [module for name, module in sys.modules.items() if name.split(".")[0] == PACKAGE]
        for module in (*owners, *of_package):
            for name, value in list(vars(module).items()):
                if value is old:
                    setattr(module, name, new)

    replace(before, now)
    try:
        yield
    finally:
        replace(now, before)
