"""From the mesh of a pose to its signature: what takes the time. Several poses side by side, cancellable."""

from __future__ import annotations

import os
import threading
import warnings
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, ThreadPoolExecutor, wait
from typing import Literal

from threadpoolctl import threadpool_limits

from ..mesh.surface import Connection, Pieces, connect, connect_alike, prepare_surface
from ..mesh.triangle_mesh import TriangleMesh
from ..spectral.eigenpairs import Accuracy, SpectrumError, memory_needed, seconds_needed
from ..spectral.intrinsic_delaunay import Laplacian, better_triangles
from ..spectral.memory import available_memory
from ..spectral.signature import wave_kernel_signature_of
from .pose_signature import PoseSignature
from .signature_cache import SignatureCache, signature_key

Progress = Callable[[str, float], None]
"""Called with the stage and the fraction of the whole that is done, 0 to 1. An error that it raises ends the work."""

VERTICES_PER_PAIR = 15
"""A surface is refined until it has this many vertices for each eigenpair: about six to the shortest wavelength."""
MAX_WORKERS = 4
"""Poses solved side by side at most: they share the memory's speed."""
PROGRESS_SECONDS = 0.1
"""Time between two reports of progress."""
BESIDE_EIGENPAIRS = 1.5
"""Time of the whole job in that of its eigenpairs, about."""


class PoseDescriber:
    """Describes poses, by the parameters of the model that is one; see `PoseSegmentation`."""

    n_eigenpairs: int
    n_energies: int
    accuracy: Accuracy
    pieces: Pieces

    def _check_parameters(self) -> None:
        """Raise ValueError if a parameter is out of range."""
        raise NotImplementedError

    def _laplacian(self) -> Literal["auto"] | Laplacian:
        """On which triangles."""
        raise NotImplementedError

    @threadpool_limits.wrap(limits=1, user_api="blas")  # so that one pose and one of several have the same bits
    def describe(
        self,
        mesh: TriangleMesh,
        connection: Connection | None = None,
        progress: Callable[[float], None] | None = None,
        cache: SignatureCache | None = None,
    ) -> PoseSignature:
        """Compute the signature of one pose, to pass it to the other methods in the place of the mesh.

        Parameters
        ----------
        mesh : TriangleMesh
            The pose.
        connection : Connection, optional
            `connect(*poses)` of all poses of the same mesh, so that it is one surface in all of them.
        progress : callable, optional
            Called with the share of the work that is done, 0 to 1. An error that it raises ends the work.
        cache : SignatureCache, optional
            Asked first, and told in the end.

        Raises
        ------
        ValueError
            If a parameter of the model is out of range or the mesh has no usable face.
        SpectrumError
            If the eigenpairs could not be computed.
        MemoryError
            If they would need more memory than is free; the message says how much.
        """
        self._check_parameters()
        connection = connection or connect(mesh, pieces=self.pieces)
        key = "" if cache is None else signature_key(mesh, connection, self.describing())
        known = None if cache is None else cache.get(key)
        if known is not None:
            return known
        surface = prepare_surface(mesh, VERTICES_PER_PAIR * self.n_eigenpairs, connection)
        n_pairs = self.n_eigenpairs + surface.n_components - 1
        mesh, laplacian = better_triangles(surface.mesh, self._laplacian())
        signature = wave_kernel_signature_of(mesh, n_pairs, self.n_energies, self.accuracy, progress)
        described = PoseSignature(surface, signature, self.n_eigenpairs, laplacian)
        if cache is not None:
            try:
                cache.put(key, described)
            except OSError as error:
                warnings.warn(f"a signature was not kept for the next time: {error}", stacklevel=2)
        return described

    def describing(self) -> dict[str, str | int]:
        """What a signature depends on, beside the mesh and what is one surface of it."""
        return {
            "n_eigenpairs": self.n_eigenpairs,
            "n_energies": self.n_energies,
            "accuracy": self.accuracy,
            "laplacian": self._laplacian(),
        }

    def describe_all(
        self,
        meshes: Sequence[TriangleMesh],
        connections: Sequence[Connection] | None = None,
        progress: Progress | None = None,
        names: Sequence[str] | None = None,
        workers: int | None = None,
        cache: SignatureCache | None = None,
    ) -> list[PoseSignature]:
        """`describe` several poses, side by side where there are cores and memory for it.

        Parameters
        ----------
        meshes
            The poses.
        connections : one a pose, optional
            See `describe`. If not given, meshes with the same faces count as poses of one mesh.
        progress
            Called from the thread that called this.
        names : optional
            What to call each pose in messages; "pose 1" and so on if not given.
        workers : int, optional
            How many poses at once; as many as there are cores and memory for if not given, at most four.
        cache : SignatureCache, optional
            Asked first, and told of each pose as soon as it is done.

        Raises
        ------
        ValueError, SpectrumError, MemoryError
            As `describe`; the message begins with the pose's name.
        """
        called = list(names) if names is not None else [f"pose {i + 1}" for i in range(len(meshes))]
        each = connect_alike(meshes, called, self.pieces) if connections is None else connections
        done = [0.0] * len(meshes)
        ended = threading.Event()

        def solve(i: int) -> PoseSignature:
            def tick(share: float) -> None:
                done[i] = share
                if ended.is_set():
                    raise CancelledError

            try:
                return self.describe(meshes[i], each[i], tick, cache)
            except (ValueError, SpectrumError, MemoryError) as error:
                kind = next(kind for kind in (MemoryError, SpectrumError, ValueError) if isinstance(error, kind))
                raise kind(f"{called[i]}: {error}") from error
            finally:
                done[i] = 1.0

        def report() -> None:
            if progress:
                current = next((i for i, share in enumerate(done) if share < 1), len(done) - 1)
                stage = f"{called[current]} ({current + 1} of {len(done)})"
                progress(f"pose {current + 1} of {len(done)}" if names is None else stage, sum(done) / len(done))

        if not len(meshes):
            return []
        # One BLAS thread a pose: narrow blocks gain nothing from more.
        with threadpool_limits(1, "blas"), ThreadPoolExecutor(workers or self._workers(meshes)) as pool:
            futures = [pool.submit(solve, i) for i in range(len(meshes))]
            try:
                waiting = set(futures)
                while waiting:
                    report()
                    finished, waiting = wait(waiting, PROGRESS_SECONDS, FIRST_COMPLETED)
                    for future in finished:
                        future.result()
            except BaseException:
                ended.set()
                for future in futures:
                    future.cancel()
                raise
        report()
        return [future.result() for future in futures]

    def estimate(self, meshes: Sequence[TriangleMesh]) -> tuple[float, int]:
        """Seconds and bytes that poses will take, roughly, before any work is done.

        Side by side they save a fifth of the time at most, which thin shapes more than need: it is not counted.
        """
        seconds = sum(seconds_needed(self._refined(mesh), self.n_eigenpairs, self.accuracy) for mesh in meshes)
        needed = sorted(memory_needed(self._refined(mesh), self.n_eigenpairs, self.accuracy) for mesh in meshes)
        return BESIDE_EIGENPAIRS * seconds, sum(needed[-self._workers(meshes) :])

    def _refined(self, mesh: TriangleMesh) -> int:
        """Vertices of the refined surface, about: what is fine already stays, the rest comes on top."""
        return mesh.n_vertices + VERTICES_PER_PAIR * self.n_eigenpairs

    def _workers(self, meshes: Sequence[TriangleMesh]) -> int:
        """Poses for which there are cores and memory at once."""
        largest = max((self._refined(mesh) for mesh in meshes), default=1)
        needed = memory_needed(largest, self.n_eigenpairs, self.accuracy)
        return max(1, min(MAX_WORKERS, len(meshes), os.cpu_count() or 1, available_memory() // needed))
