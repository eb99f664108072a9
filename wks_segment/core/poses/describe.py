"""From the mesh of a pose to its signature, which takes most of the time: several poses in parallel, cancelable."""

from __future__ import annotations

import os
import threading
import warnings
from collections.abc import Iterable, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, ThreadPoolExecutor, wait
from functools import partial
from typing import Literal, NamedTuple

import numpy as np

from ..mesh.surface import Connection, IslandMode, connect, connect_alike, prepare_surface
from ..mesh.triangle_mesh import TriangleMesh
from ..message import Message, message_of
from ..progress import Progress, ReportFunction, ShareFunction
from ..spectral.eigenpairs import Accuracy, SpectrumError, memory_needed, seconds_needed
from ..spectral.intrinsic_delaunay import Laplacian, better_triangles
from ..spectral.memory import available_memory
from ..spectral.signature import wave_kernel_signature_of
from ..threads import one_blas_thread
from .arguments import as_list
from .pose_cache import AnyPose, Workpiece
from .pose_signature import PoseSignature
from .signals import signals_held
from .signature_cache import SignatureCache, signature_key

VERTICES_PER_PAIR = 15
"""A surface is refined until it has this many vertices for each eigenpair: about six to the shortest wavelength."""
MAX_WORKERS = 4
"""Maximum number of poses computed in parallel: more do not get faster, because they share the memory bandwidth."""
PROGRESS_SECONDS = 0.1
"""Seconds between two reports of progress, and so the longest time until a job notices that it is canceled."""
BESIDE_EIGENPAIRS = 1.5
"""Time of a whole job as a multiple of the time of its eigenpairs, about."""
SIGNATURE_BYTES = 16
"""Bytes of a number of a signature while it is computed and standardized: it is there twice."""

SURFACE = 0.07
"""Share of the time of a pose after which its surface is prepared."""


class Duration(NamedTuple):
    """Seconds of a processor for a job, for each of its poses, and for each vertex of a refined pose."""

    job: float
    pose: float
    vertex: float

    def of(self, n_poses: int, n_vertices: float) -> float:
        """Seconds for poses that have so many vertices on average."""
        return self.job + n_poses * (self.pose + self.vertex * n_vertices)


SIGNATURE, EIGENPAIRS_FACTOR = Duration(0.0, 0.036, 6e-5), 0.76
"""Seconds of the signatures of poses: these, and a multiple of the estimate of their eigenpairs."""
LEARNING, LABELING = Duration(0.4, 0.34, 7.5e-5), Duration(0.0, 0.026, 3.6e-5)
"""To learn from described poses, and to label them with a given model. All of these are fitted to the shares of
signatures that `python -m benchmarks.progress` measures, which decide the progress bar: within 0.06 on its cases."""


class PoseDescriber:
    """Base of models: describes poses by the parameters of the model; see `PoseSegmentation`."""

    n_eigenpairs: int
    n_energies: int
    accuracy: Accuracy
    pieces: IslandMode

    def _check_parameters(self) -> None:
        """Raise ValueError if a parameter is out of range."""
        raise NotImplementedError

    def _laplacian(self) -> Literal["auto"] | Laplacian:
        """The parameter `laplacian`, after the preset."""
        raise NotImplementedError

    @one_blas_thread  # so that a pose has the same digits by itself and among several
    def describe(
        self,
        mesh: TriangleMesh,
        connection: Connection | None = None,
        progress: ShareFunction | Progress | None = None,
        cache: SignatureCache | None = None,
    ) -> PoseSignature:
        """Compute the signature of one pose; every other method accepts the result instead of the mesh.

            pose = model.describe(mesh)
            labels, regions = model.segment_faces(pose), model.segment_regions(pose)

        Parameters
        ----------
        mesh : TriangleMesh
            The pose.
        connection : Connection, optional
            `connect(*poses)` of all poses of the same mesh, so that the mesh is connected alike in all of them.
        progress : callable, optional
            Called with the share of the work that is done, 0 to 1. An error that it raises cancels the work.
        cache : SignatureCache, optional
            Searched for the signature first; a new signature is added to it.

        Raises
        ------
        ValueError
            If a parameter of the model is out of range or the mesh has no usable face.
        SpectrumError
            If the eigenpairs could not be computed.
        MemoryError
            If the eigenpairs would need more memory than is free; the message says how much.
        """
        self._check_parameters()
        connection = connection or connect(mesh, pieces=self.pieces)
        key = "" if cache is None else signature_key(mesh, connection, self.describing())
        known = None if cache is None else cache.get(key)
        if known is not None:
            return known
        surface = prepare_surface(mesh, VERTICES_PER_PAIR * self.n_eigenpairs, connection)
        n_pairs = self.n_eigenpairs + surface.n_islands - 1
        mesh, laplacian = better_triangles(surface.mesh, self._laplacian())
        step = Progress.of_share(progress)
        step = step.part(SURFACE, 1.0)
        step(0.0)
        signature = wave_kernel_signature_of(mesh, n_pairs, self.n_energies, self.accuracy, step)
        pose = PoseSignature(surface, signature, self.n_eigenpairs, laplacian)
        if cache is not None:
            try:
                cache.put(key, pose)
            except OSError as error:
                warnings.warn(
                    Message("a signature was not kept for the next time: {reason}", reason=message_of(error)),
                    stacklevel=3,
                )
        return pose

    def describing(self) -> dict[str, str | int]:
        """Parameters that a signature depends on, besides the mesh and how it is connected."""
        return {
            "n_eigenpairs": self.n_eigenpairs,
            "n_energies": self.n_energies,
            "accuracy": self.accuracy,
            "laplacian": self._laplacian(),
        }

    def describing_share(self, new: Sequence[TriangleMesh], n_poses: int, rest: Duration) -> float:
        """Share of the time of a job that is spent on signatures.

        Parameters
        ----------
        new
            The poses whose signature must be computed.
        n_poses : int
            Number of all poses of the job.
        rest : Duration
            Of the rest of the job.
        """
        if not new:
            return 0.0
        signatures, sizes = self.describing_seconds(new), [self._n_refined(mesh) for mesh in new]
        return signatures / (signatures + rest.of(n_poses, float(np.mean(sizes))))

    def describing_seconds(self, meshes: Sequence[TriangleMesh]) -> float:
        """Rough estimate of the seconds of a processor that the signatures of poses take."""
        sizes = [self._n_refined(mesh) for mesh in meshes]
        eigenpairs = sum(seconds_needed(size, self.n_eigenpairs, self.accuracy) for size in sizes)
        return SIGNATURE.of(len(sizes), float(np.mean(sizes)) if sizes else 0.0) + EIGENPAIRS_FACTOR * eigenpairs

    @one_blas_thread  # poses run in parallel instead: matrices this narrow gain nothing from more threads
    def describe_all(
        self,
        meshes: Iterable[TriangleMesh],
        connections: Sequence[Connection] | None = None,
        progress: ReportFunction | Progress | None = None,
        names: Sequence[str] | None = None,
        workers: int | None = None,
        cache: SignatureCache | None = None,
        known: Sequence[PoseSignature | None] = (),
    ) -> list[PoseSignature]:
        """`describe` several poses, in parallel if there are cores and memory for it.

        Parameters
        ----------
        meshes
            The poses.
        connections : one for each pose, optional
            See `describe`. If not given, meshes with the same faces count as poses of one mesh.
        progress
            Called with the stage and the share of the work that is done, 0 to 1, in the thread that called this. An
            error that it raises cancels the work.
        names : optional
            Name of each pose in messages; "pose 1" and so on if not given.
        workers : int, optional
            Number of poses at once; if not given, as many as there are cores and memory for, at most four.
        cache : SignatureCache, optional
            Searched for signatures first; each new signature is added to it as soon as it is computed.
        known : one for each pose, optional
            Result of `known_signatures`, if that was called before: the cache is not searched again for these.

        Raises
        ------
        ValueError, SpectrumError, MemoryError
            As by `describe`; the message begins with the name of the pose.
        """
        meshes = as_list(meshes, "meshes")
        if not meshes:
            return []
        called = names or [Message("pose {number}", number=i + 1) for i in range(len(meshes))]
        connected = connect_alike(meshes, called, self.pieces) if connections is None else connections
        found = list(known) or [None] * len(meshes)
        new = [i for i, signature in enumerate(found) if signature is None]
        shared = _SharedProgress(Progress.of(progress), names, new, len(meshes))

        def describe_one(i: int) -> PoseSignature:
            try:
                return self.describe(meshes[i], connected[i], shared.of_pose(i), cache)
            except (ValueError, SpectrumError, MemoryError) as error:
                kind = next(kind for kind in (MemoryError, SpectrumError, ValueError) if isinstance(error, kind))
                raise kind(Message("{name}: {reason}", name=called[i], reason=message_of(error))) from error
            finally:
                shared.finish(i)

        futures: dict[int, Future[PoseSignature]] = {}
        with signals_held() as let_signals_in, ThreadPoolExecutor(workers or self._workers(meshes)) as pool:
            try:
                futures |= {i: pool.submit(describe_one, i) for i in new}
                waiting = set(futures.values())
                while waiting:
                    let_signals_in()
                    shared.report()
                    finished, waiting = wait(waiting, PROGRESS_SECONDS, FIRST_COMPLETED)
                    for future in finished:
                        future.result()
            except BaseException:
                shared.cancel()
                for future in futures.values():
                    future.cancel()
                raise
        shared.report()
        return [futures[i].result() if signature is None else signature for i, signature in enumerate(found)]

    def known_signatures(
        self, meshes: Sequence[TriangleMesh], connections: Sequence[Connection], cache: SignatureCache | None
    ) -> list[PoseSignature | None]:
        """The signature of each pose that is in a cache; None for those that must be computed."""
        if cache is None:
            return [None] * len(meshes)
        keys = [signature_key(*pose, self.describing()) for pose in zip(meshes, connections, strict=True)]
        return [cache.get(key) for key in keys]

    def estimate(self, meshes: Sequence[TriangleMesh]) -> tuple[float, int]:
        """Rough estimate of the seconds and bytes that `describe_all` will take.

        Parallel work is not counted: it saves a fifth of the time at most, and thin shapes need more than that in
        addition.
        """
        seconds = sum(seconds_needed(self._n_refined(mesh), self.n_eigenpairs, self.accuracy) for mesh in meshes)
        needed = sorted(
            memory_needed(self._n_refined(mesh), self.n_eigenpairs, self.accuracy)
            + SIGNATURE_BYTES * self._n_refined(mesh) * self.n_energies
            for mesh in meshes
        )
        return BESIDE_EIGENPAIRS * seconds, sum(needed[-self._workers(meshes) :])

    def _described(self, mesh: AnyPose) -> Workpiece:
        """The pose with its signature, computed if it has none.

        TypeError if it is not a pose; ValueError if its signature was made with other parameters.
        """
        pose = mesh.pose if isinstance(mesh, Workpiece) else mesh
        if isinstance(pose, TriangleMesh):
            return Workpiece(self.describe(pose))
        if not isinstance(pose, PoseSignature):
            raise TypeError(f"a pose must be a TriangleMesh or a PoseSignature, not {type(pose).__name__}")
        n_energies = pose.signature.shape[1]
        if (pose.n_eigenpairs, n_energies) != (self.n_eigenpairs, self.n_energies):
            raise ValueError(
                Message(
                    "the signature has {pairs} eigenpairs and {energies} energies, "
                    "the model {model_pairs} and {model_energies}",
                    pairs=pose.n_eigenpairs,
                    energies=n_energies,
                    model_pairs=self.n_eigenpairs,
                    model_energies=self.n_energies,
                )
            )
        return mesh if isinstance(mesh, Workpiece) else Workpiece(pose)

    def _all_described(
        self, meshes: Sequence[AnyPose], progress: Progress, cache: SignatureCache | None
    ) -> tuple[list[Workpiece], float]:
        """The poses with their signatures, which are computed for those that have none, and the share of learning then.

        Parameters
        ----------
        meshes
        progress : Progress
            Of learning from the poses.
        cache : SignatureCache or None
        """
        new = {i: mesh for i, mesh in enumerate(meshes) if isinstance(mesh, TriangleMesh)}
        bare = list(new.values())
        names = [Message("pose {number}", number=i + 1) for i in range(len(bare))]
        connections = connect_alike(bare, names, self.pieces)
        known = self.known_signatures(bare, connections, cache)
        unknown = [mesh for mesh, signature in zip(bare, known, strict=True) if signature is None]
        share = self.describing_share(unknown, len(meshes), LEARNING)
        part = progress.part(0.0, share)
        signatures = self.describe_all(bare, connections, part, cache=cache, known=known)
        described = dict(zip(new, signatures, strict=True))
        return [self._described(described.get(i, mesh)) for i, mesh in enumerate(meshes)], share

    def _n_refined(self, mesh: TriangleMesh) -> int:
        """About how many vertices the refined surface has: the mesh's own vertices stay, refining adds the others."""
        return mesh.n_vertices + VERTICES_PER_PAIR * self.n_eigenpairs

    def _workers(self, meshes: Sequence[TriangleMesh]) -> int:
        """Number of poses for which there are cores and memory at the same time."""
        largest = max((self._n_refined(mesh) for mesh in meshes), default=1)
        needed = memory_needed(largest, self.n_eigenpairs, self.accuracy)
        return max(1, min(MAX_WORKERS, len(meshes), os.cpu_count() or 1, available_memory() // needed))


class _SharedProgress:
    """Progress of poses that several threads describe, which one thread reports.

    Parameters
    ----------
    progress : Progress
        Of all poses together.
    names : sequence of str, optional
        Of the poses, for the stage that is reported.
    new : sequence of int
        The poses that are described; the signatures of the others are known.
    n_poses : int
    """

    def __init__(self, progress: Progress, names: Sequence[str] | None, new: Sequence[int], n_poses: int) -> None:
        self._progress, self._names, self._n_poses = progress, names, n_poses
        self._done = dict.fromkeys(new, 0.0)
        self._canceled = threading.Event()

    def of_pose(self, i: int) -> Progress:
        """Progress of one pose, for the thread that describes it; raises CancelledError there after `cancel`."""
        return Progress.of_share(partial(self._note, i))

    def finish(self, i: int) -> None:
        """Count a pose as done."""
        self._done[i] = 1.0

    def cancel(self) -> None:
        """End the work on all poses at their next report."""
        self._canceled.set()

    def report(self) -> None:
        """Report the mean over the poses, under the name of the first pose that is not done."""
        current = next((i for i, share in self._done.items() if share < 1), self._n_poses - 1)
        if self._names is None:
            stage = Message("pose {number} of {count}", number=current + 1, count=self._n_poses)
        else:
            name = self._names[current]
            stage = Message("{name} ({number} of {count})", name=name, number=current + 1, count=self._n_poses)
        self._progress(sum(self._done.values()) / len(self._done) if self._done else 1.0, stage)

    def _note(self, i: int, share: float) -> None:
        self._done[i] = share
        if self._canceled.is_set():
            raise CancelledError
