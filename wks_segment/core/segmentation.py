"""Parts that are the same in every pose: one Gaussian mixture over the signatures of several poses.

Aubry, Schlickewei and Cremers, "Pose-consistent 3D shape segmentation based on a quantum mechanical feature
descriptor" (2011).
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, ThreadPoolExecutor, wait
from dataclasses import dataclass
from os import PathLike
from typing import Any, Literal, get_args

import numpy as np
from scipy.sparse import csr_matrix, diags
from threadpoolctl import threadpool_limits

from . import model_file
from .cut import crease_weights, cut_borders
from .grouping import Contacts, Ground, Grouping
from .intrinsic import Laplacian, better_triangles
from .laplacian import unit_area_masses
from .memory import available_memory
from .mesh import BoolArray, FloatArray, IntArray, TriangleMesh
from .mixture import CovarianceType, GaussianMixture, TooFewSamplesError, drawn_evenly, fit_mixtures
from .parts import parts
from .regions import FaceAdjacency, connected_regions, merge_crumbs, smooth_posteriors
from .signature import wave_kernel_signature_of
from .spectrum import Accuracy, SpectrumError, memory_needed, seconds_needed
from .surface import Connection, Pieces, Surface, connect_alike, indicator, prepare_surface

Scaling = Literal["log", "raw"]
Preset = Literal["default", "paper"]
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
DESCRIBED = 0.8
"""Share of the work that is signatures."""
MIXED = 0.9
"""Share of the work when the mixture is fitted."""
AUTO: tuple[CovarianceType, ...] = ("shared", "diag")
"""Covariances that `covariance_type="auto"` tries on several poses of one mesh; else it takes the first."""
CANDIDATES = 3
"""Mixtures of each covariance whose groups are compared."""
EARNED = 0.8
"""Another covariance than the first is taken if its labels disagree less than this share as much between the poses."""
COMPARED = 4_000
"""Faces on which the labels of the learned poses are compared."""
REGROUPED = 5
"""Rounds of joining at most, until no segment is lost as crumbs."""
COMPONENTS, PER_SEGMENT, MOST_MORE = 24, 3, 64
"""Components of the mixture: at least so many, and so many for each segment, but at most so many more than segments."""
SIGNATURE_OFFSET = 1.0
"""Added to the signature, whose mean is 1, before its logarithm: smaller values change much from pose to pose and say
little, and tiny loose parts take no part in low energies."""
MOST_SMOOTHNESS = 10
MAX_SAMPLES = 20_000
"""Vertices that take part in the mixture, spread evenly by area where there are more."""
MIN_SHARE = 0.005
"""Smallest part, as a share of the area."""
MARKED = 0.1
"""What a border at a marked edge costs, as a share of what it would."""
SMOOTHING_LENGTH = 0.03
"""Width of the smoothing along borders at smoothness 1, in units of the square root of the area."""
PAPER: dict[str, Any] = {
    "covariance_type": "diag", "scaling": "raw", "laplacian": "cotangent", "smoothness": 0.0,
}  # fmt: skip
"""What `preset="paper"` means: a mixture of the signatures themselves, started once, and its components as labels."""


@dataclass(frozen=True)
class PoseSignature:
    """One pose, described: what takes the time, to be computed once and used for learning and labelling.

    Attributes
    ----------
    surface : Surface
        The welded and refined surface, with n' vertices.
    signature : (n', n_energies) array of float
    n_eigenpairs : int
        What it was computed from.
    laplacian : "cotangent" or "delaunay"
        The triangles that it was computed on.
    """

    surface: Surface
    signature: FloatArray
    n_eigenpairs: int
    laplacian: Laplacian = "cotangent"


class PoseSegmentation:
    """Learns a character's parts from several poses and finds them in any pose.

    Parameters
    ----------
    n_segments : int or "auto"
        Parts to find, where left and right count as one. A segment is a group of components of the mixture; with the
        paper's setting each component is one. "auto": as many as are nearly as certain as any number, see
        `Grouping.best_number`; not for the paper's setting.
    covariance_type : "auto", "shared", "diag", "full", "tied" or "spherical"
        "shared" is one diagonal covariance for all components, the paper's remark and the most robust on bodies that
        were not learned from. "auto" takes it, unless the poses are of one mesh and "diag" gives labels that agree far
        better between them. "tied" and "full" have one component a segment.
    n_eigenpairs : int
        Eigenpairs of each pose, without the zero modes of further components.
    n_energies : int
        Length of the signature.
    accuracy : "fast" or "exact"
        See `eigenpairs`.
    random_state : int
        Seed of the one start by k-means in the paper's setting. Otherwise nothing is drawn at random.
    scaling : "log" or "raw"
        What enters the mixture: the logarithm of the signature, so that fine parts do not outweigh limbs, or the
        signature as the paper has it.
    pieces : "joined" or "separate"
        Loose parts tied to what they are nearest to, so that they make sense together, or each by itself.
    laplacian : "auto", "cotangent" or "delaunay"
        The paper's cotangents on the mesh's own triangles, or on better ones between the same vertices (`delaunay`);
        "auto" takes the mesh's own unless they are full of slivers.
    smoothness : float
        How smooth borders are and how large the smallest part; 0: every vertex has the label of its own signature.
    preset : "default" or "paper"
        "paper" overrides `covariance_type`, `scaling`, `laplacian` and `smoothness` by the paper's own setting.

    Attributes
    ----------
    mixture_ : GaussianMixture
        In the space of centred and scaled signatures, with K components.
    grouping_ : Grouping or None
        In which order components make segments; None with the paper's setting.
    n_segments_ : int
        Segments found.
    centre_, spread_ : (n_energies,) arrays
        Mean and standard deviation of the training signatures over the area.
    """

    def __init__(
        self,
        n_segments: int | Literal["auto"] = 8,
        covariance_type: Literal["auto"] | CovarianceType = "auto",
        n_eigenpairs: int = 300,
        n_energies: int = 100,
        accuracy: Accuracy = "fast",
        random_state: int = 0,
        scaling: Scaling = "log",
        pieces: Pieces = "joined",
        laplacian: Literal["auto"] | Laplacian = "auto",
        smoothness: float = 1.0,
        preset: Preset = "default",
    ) -> None:
        self.n_segments = n_segments
        self.covariance_type = covariance_type
        self.n_eigenpairs = n_eigenpairs
        self.n_energies = n_energies
        self.accuracy = accuracy
        self.random_state = random_state
        self.scaling = scaling
        self.pieces = pieces
        self.laplacian = laplacian
        self.smoothness = smoothness
        self.preset = preset

    def describe(
        self,
        mesh: TriangleMesh,
        connection: Connection | None = None,
        progress: Callable[[float], None] | None = None,
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
        surface = prepare_surface(mesh, VERTICES_PER_PAIR * self.n_eigenpairs, connection, self.pieces)
        n_pairs = self.n_eigenpairs + surface.n_components - 1
        mesh, laplacian = better_triangles(surface.mesh, self._setting("laplacian"))
        signature = wave_kernel_signature_of(mesh, n_pairs, self.n_energies, self.accuracy, progress)
        return PoseSignature(surface, signature, self.n_eigenpairs, laplacian)

    def describe_all(
        self,
        meshes: Sequence[TriangleMesh],
        connections: Sequence[Connection] | None = None,
        progress: Progress | None = None,
        names: Sequence[str] | None = None,
        workers: int | None = None,
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
                return self.describe(meshes[i], each[i], tick)
            except (ValueError, SpectrumError, MemoryError) as error:
                kind = next(kind for kind in (MemoryError, SpectrumError, ValueError) if isinstance(error, kind))
                raise kind(f"{called[i]}: {error}") from error
            finally:
                done[i] = 1.0

        def report() -> None:
            if progress:
                current = next((i for i, share in enumerate(done) if share < 1), len(done) - 1)
                place = f"{current + 1} of {len(done)}"
                progress(f"pose {place}" if names is None else f"{called[current]} ({place})", sum(done) / len(done))

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
        free = available_memory()
        by_memory = MAX_WORKERS if free is None else free // needed
        return max(1, min(MAX_WORKERS, len(meshes), os.cpu_count() or 1, by_memory))

    def fit(self, meshes: Sequence[TriangleMesh | PoseSignature], progress: Progress | None = None) -> PoseSegmentation:
        """Learn the parts from one or more poses together.

        Parameters
        ----------
        meshes
            The poses; they need not share their meshing. Each counts the same, whatever its size and number of
            vertices. One pose alone is allowed, but says nothing of what a pose changes.
        progress
            Called while the poses are described and the mixture is fitted.

        Raises
        ------
        ValueError
            If there is no pose, a parameter is out of range, or there are fewer vertices than segments.
        SpectrumError, MemoryError
            If the eigenpairs of a pose could not be computed; see `describe`.
        """
        self._check_parameters()
        if not len(meshes):
            raise ValueError("there is no pose to learn from: pass one mesh at least, better three to five")
        tick = progress or (lambda stage, share: None)
        new = {i: mesh for i, mesh in enumerate(meshes) if isinstance(mesh, TriangleMesh)}
        found = self.describe_all(list(new.values()), None, lambda stage, share: tick(stage, DESCRIBED * share))
        described = dict(zip(new, found, strict=True))
        poses = [described.get(i) or self._described(mesh) for i, mesh in enumerate(meshes)]
        tick("mixture", DESCRIBED)
        weights = np.concatenate([unit_area_masses(pose.surface.mesh) for pose in poses])
        if self._least_components() > len(weights):
            raise ValueError(f"n_segments is {self.n_segments}, but the poses have only {len(weights)} vertices")
        shares = weights / weights.sum()
        signatures = [pose.signature for pose in poses]
        if len(shares) > MAX_SAMPLES:
            drawn = drawn_evenly(shares, MAX_SAMPLES)
            starts = np.cumsum([0, *(len(signature) for signature in signatures)])
            first = np.searchsorted(drawn, starts)
            signatures = [
                signature[drawn[first[i] : first[i + 1]] - starts[i]] for i, signature in enumerate(signatures)
            ]
            shares = np.full(MAX_SAMPLES, 1 / MAX_SAMPLES)
        samples = self._scaled(np.concatenate(signatures)).astype(np.float64)
        self.centre_ = shares @ samples
        self.spread_ = np.maximum(np.sqrt(shares @ (samples - self.centre_) ** 2), model_file.LEAST)
        if self.preset == "paper":
            self.spread_ = np.ones_like(self.spread_)
        samples = (samples - self.centre_) / self.spread_
        mixtures = self._mixtures(
            samples, shares, _alike(poses), lambda share: tick("mixture", DESCRIBED + (MIXED - DESCRIBED) * share)
        )
        self.mixture_ = mixtures[0]
        self.grouping_: Grouping | None = None
        if self.preset != "paper":
            self._group(poses, mixtures, lambda share: tick("parts", MIXED + (1 - MIXED) * share))
        tick("done", 1.0)
        return self

    def predict(self, mesh: TriangleMesh | PoseSignature) -> IntArray:
        """(n,) segment of each vertex: the one with the highest posterior, as in the paper."""
        return np.asarray(self.predict_proba(mesh).argmax(axis=1))

    def predict_proba(self, mesh: TriangleMesh | PoseSignature) -> FloatArray:
        """(n, n_segments) posterior of each segment at each vertex; rows sum to 1."""
        self._fitted()
        pose = self._described(mesh)
        return pose.surface.to_vertices(self._posteriors(pose))

    @threadpool_limits.wrap(limits=1, user_api="blas")  # as in _clean
    def predict_soft(self, mesh: TriangleMesh | PoseSignature) -> FloatArray:
        """(n, n_segments) posteriors as `predict_proba` has them, smoothed as far as the labels of faces are."""
        self._fitted()
        pose = self._described(mesh)
        posteriors, smoothness = self._posteriors(pose), self._setting("smoothness")
        if smoothness > 0:
            smooth = smooth_posteriors(pose.surface.mesh, posteriors, smoothness * SMOOTHING_LENGTH)
            # Obtuse triangles let the heat flow a little beyond 0 and 1.
            posteriors = np.clip(smooth, 0, 1).astype(np.float64)
            posteriors /= posteriors.sum(axis=1, keepdims=True)
        return pose.surface.to_vertices(posteriors)

    def score(self, mesh: TriangleMesh | PoseSignature) -> float:
        """Mean log-likelihood of the signature over the area: how well the model explains a shape (section 5).

        Comparable between models with the same number of energies and the same scaling.
        """
        mixture = self._fitted()
        pose = self._described(mesh)
        likelihoods = mixture.log_likelihoods(self._standardised(pose.signature))
        masses = unit_area_masses(pose.surface.mesh)
        # A density in standardised units, brought back to those of the signature that models share.
        return float(masses @ likelihoods / masses.sum() - np.log(self.spread_).sum())

    def segment_faces(self, mesh: TriangleMesh | PoseSignature, min_share: float | None = None) -> IntArray:
        """(m,) component of each face, cleaned: smooth borders, no connected part under `min_share` of the area.

        `min_share` is 0.005 if not given, and 0 without smoothing.
        A loose piece that is smaller as a whole takes the label of what is next to it.
        """
        self._fitted()
        return self._clean([self._described(mesh)], None, min_share)[0]

    def segment_regions(self, mesh: TriangleMesh | PoseSignature, min_share: float | None = None) -> IntArray:
        """(m,) connected part of each face, numbered 0, 1, …: left and right hand are two.

        Cut as a person would: between components, along creases and where the thickness changes, and not within what
        has neither (see `parts`); without smoothing, the connected parts of the components. Parts under `min_share` of
        the area belong to the part next to them. Numbered by component first.
        """
        self._fitted()
        pose = self._described(mesh)
        labels, adjacency = self._clean([pose], None, min_share)
        if self._setting("smoothness") == 0:
            return connected_regions(labels, adjacency)
        original = pose.surface.original
        own = FaceAdjacency.of(pose.surface.welded_faces, original.vertices)
        centres = original.vertices[original.faces].mean(axis=1)
        cut = parts(pose.surface, labels, own)
        part, tied = merge_crumbs(cut, original.face_areas, centres, own, self._least_share(min_share))
        region = connected_regions(part, tied)
        # The component that most of a region's area belongs to decides on its number.
        shares = np.zeros((int(region.max()) + 1, self.n_segments_))
        np.add.at(shares, (region, labels), original.face_areas)
        return np.asarray(np.argsort(np.lexsort((np.arange(len(shares)), shares.argmax(axis=1))))[region])

    def segment_polygons(
        self,
        poses: Sequence[TriangleMesh | PoseSignature],
        polygons: Sequence[IntArray],
        min_share: float | None = None,
        progress: Callable[[float], None] | None = None,
        marked: IntArray | None = None,
    ) -> IntArray:
        """Label the polygons of one mesh, seen in one or several poses, as `segment_faces` does.

        Parameters
        ----------
        poses
            The same mesh in each pose, as triangles. The posteriors of all poses are averaged.
        polygons
            For each pose, the polygon that each triangle is a piece of; several triangles can be of one polygon, and
            -1 stands for a triangle of none, which shapes the surface but has no say.
        progress
            Called after each pose with the share that is done, 0 to 1. An error that it raises ends the work.
        marked : (q, 2) int array, optional
            Neighbouring polygons between which a border is welcome, as at hard edges, seams and borders of materials:
            one nearby moves there.

        Returns
        -------
        (p,) segment of each polygon, 0 to the largest number in `polygons`; -1 for one without a triangle in any
        pose.

        Raises
        ------
        ValueError
            If there is no pose, or the lengths do not fit.
        """
        self._fitted()
        described = [self._described(pose) for pose in poses]
        if not described or len(described) != len(polygons):
            raise ValueError(f"there are {len(described)} poses, but polygons for {len(polygons)}")
        for i, (pose, polygon_of) in enumerate(zip(described, polygons, strict=True)):
            if np.shape(polygon_of) != (pose.surface.original.n_faces,):
                raise ValueError(
                    f"pose {i} has {pose.surface.original.n_faces} triangles, but polygons for {np.shape(polygon_of)}"
                )
        return self._clean(described, polygons, min_share, progress, marked)[0]

    def save(self, path: str | PathLike[str]) -> None:
        """Write the fitted model to a JSON file that holds data only.

        Raises
        ------
        ValueError
            If the model is not fitted, or too large to be read again.
        OSError
            If the file cannot be written.
        """
        model_file.write(path, self.to_json())

    @classmethod
    def load(cls, path: str | PathLike[str]) -> PoseSegmentation:
        """Read a model that `save` wrote.

        Raises
        ------
        ModelFileError
            If the file is no model, damaged, or of a newer version (a ValueError).
        OSError
            If the file cannot be read.
        """
        return cls.from_json(model_file.read(path))

    def to_json(self) -> str:
        """The fitted model as JSON text; ValueError if it is not fitted."""
        mixture = self._fitted()
        arrays = {
            "centre": self.centre_, "spread": self.spread_, "weights": mixture.weights, "means": mixture.means,
            "covariances": mixture.covariances,
        }  # fmt: skip
        if self.grouping_ is not None:
            arrays["joins"] = self.grouping_.pairs
            arrays |= {"certainties": self.grouping_.certainties, "by_chance": self.grouping_.by_chance}
        return model_file.encode(
            {name: getattr(self, name) for name in model_file.PARAMETERS},
            arrays,
            mixture.covariance_type,
        )

    @classmethod
    def from_json(cls, text: str) -> PoseSegmentation:
        """The model in JSON text; ModelFileError if it is none."""
        parameters, arrays, covariance_type = model_file.decode(text)
        model = cls(**parameters)
        try:
            model._check_parameters()
        except (ValueError, TypeError) as error:
            raise model_file.ModelFileError(f"the model has a bad parameter: {error}") from error
        model.centre_, model.spread_ = arrays["centre"], arrays["spread"]
        model.grouping_ = (
            Grouping(arrays["joins"].astype(np.int64), arrays["certainties"], arrays["by_chance"])
            if "joins" in arrays
            else None
        )
        model.mixture_ = GaussianMixture(covariance_type, arrays["weights"], arrays["means"], arrays["covariances"])
        return model

    def _check_parameters(self) -> None:
        least_of = {"n_segments": 1, "n_eigenpairs": 3, "n_energies": 2, "random_state": 0}
        if self.n_segments == "auto":
            if self.preset == "paper":
                raise ValueError('n_segments must be a number with preset="paper": "auto" needs the default preset')
            del least_of["n_segments"]
        for name, least in least_of.items():
            value = getattr(self, name)
            if not isinstance(value, int | np.integer) or value < least:
                raise ValueError(f"{name} must be a whole number of at least {least}, not {value!r}")
        choices = {
            "covariance_type": ("auto", *get_args(CovarianceType)),
            "accuracy": get_args(Accuracy),
            "scaling": get_args(Scaling),
            "pieces": get_args(Pieces),
            "laplacian": ("auto", *get_args(Laplacian)),
            "preset": get_args(Preset),
        }
        if not isinstance(self.smoothness, int | float) or not 0 <= self.smoothness <= MOST_SMOOTHNESS:
            raise ValueError(f"smoothness must be a number from 0 to {MOST_SMOOTHNESS}, not {self.smoothness!r}")
        for name, allowed in choices.items():
            if getattr(self, name) not in allowed:
                raise ValueError(f"{name} must be one of {allowed}, not {getattr(self, name)!r}")

    def _least_share(self, min_share: float | None) -> float:
        """Smallest part, as a share of the area; ValueError if it is none."""
        if min_share is None:
            return MIN_SHARE if self._setting("smoothness") > 0 else 0.0
        if not 0 <= min_share < 1:
            raise ValueError(f"min_share must be from 0 to below 1, not {min_share!r}")
        return min_share

    def _setting(self, name: str) -> Any:
        """What holds for a parameter that the preset may override."""
        return PAPER[name] if self.preset == "paper" else getattr(self, name)

    def _fitted(self) -> GaussianMixture:
        if not hasattr(self, "mixture_"):
            raise ValueError("the model is not fitted: call fit, or load a model, first")
        return self.mixture_

    def _described(self, mesh: TriangleMesh | PoseSignature) -> PoseSignature:
        if isinstance(mesh, PoseSignature):
            got = (mesh.n_eigenpairs, mesh.signature.shape[1])
            if got != (self.n_eigenpairs, self.n_energies):
                raise ValueError(
                    f"the signature is of {got[0]} eigenpairs and {got[1]} energies, "
                    f"the model of {self.n_eigenpairs} and {self.n_energies}"
                )
            return mesh
        if not isinstance(mesh, TriangleMesh):
            raise TypeError(f"a pose must be a TriangleMesh or a PoseSignature, not {type(mesh).__name__}")
        return self.describe(mesh)

    def _scaled(self, signature: FloatArray) -> FloatArray:
        return np.log(signature + SIGNATURE_OFFSET) if self._setting("scaling") == "log" else signature

    def _standardised(self, signature: FloatArray) -> FloatArray:
        scaled = self._scaled(signature)  # a new array, or the signature itself; in its own precision
        return np.asarray((scaled - self.centre_.astype(scaled.dtype)) / self.spread_.astype(scaled.dtype))

    def _mixtures(
        self, samples: FloatArray, shares: FloatArray, alike: bool, tick: Callable[[float], None]
    ) -> list[GaussianMixture]:
        """Mixtures that may do."""
        wanted, covariance_type = self._least_components(), self._setting("covariance_type")
        if self.preset == "paper":
            return fit_mixtures(samples, shares, wanted, covariance_type, self.random_state, 1, tick)
        types = (AUTO if alike else AUTO[:1]) if covariance_type == "auto" else (covariance_type,)
        found = []
        for i, each in enumerate(types):

            def part(share: float, begun: int = i) -> None:
                tick((begun + share) / len(types))

            n_components = min(max(COMPONENTS, PER_SEGMENT * wanted), wanted + MOST_MORE, len(samples))
            if each in ("tied", "full"):
                # A finer mixture of these would take minutes, and learn every pose by heart.
                n_components = max(wanted, COMPONENTS // PER_SEGMENT) if self.n_segments == "auto" else wanted
            try:
                found += fit_mixtures(samples, shares, n_components, each, None, CANDIDATES, part)
            except TooFewSamplesError as error:
                # A cube has three different vertices at most: no more components than that.
                n_components = max(wanted, error.distinct)
                found += fit_mixtures(samples, shares, n_components, each, None, CANDIDATES, part)
        return found

    @threadpool_limits.wrap(limits=1, user_api="blas")  # as in `_clean`
    def _group(
        self, poses: Sequence[PoseSignature], mixtures: list[GaussianMixture], tick: Callable[[float], None]
    ) -> None:
        """Keep the mixture whose groups are the most certain, and its grouping."""
        contacts: list[list[Contacts]] = [[] for _ in mixtures]
        samples: list[list[FloatArray]] = [[] for _ in mixtures]
        first = poses[0].surface.original
        drawn = drawn_evenly(first.face_areas / first.area, COMPARED) if _alike(poses) else None
        for i, pose in enumerate(poses):
            tick(i / len(poses))
            ground, standardised = Ground.of(pose.surface), self._standardised(pose.signature)
            for mixture, found, kept in zip(mixtures, contacts, samples, strict=True):
                smooth = smooth_posteriors(pose.surface.mesh, mixture.posteriors(standardised), SMOOTHING_LENGTH)
                of_faces = pose.surface.to_faces(smooth)
                found.append(Contacts.on(ground, of_faces))
                if drawn is not None:
                    kept.append(of_faces[drawn])
        means = [Contacts.mean(found) for found in contacts]
        if drawn is not None:
            means = [mean.with_changes(np.stack(kept)) for mean, kept in zip(means, samples, strict=True)]
        groupings = [Grouping.of(mean) for mean in means]
        if drawn is None:
            scores = [grouping.certainties[self._number(grouping) - 1] for grouping in groupings]
        else:
            scores = []
            for grouping, kept in zip(groupings, samples, strict=True):
                number = self._number(grouping)
                labels = np.stack([(each @ np.eye(number)[grouping.groups(number)]).argmax(axis=1) for each in kept])
                scores.append(float((labels[:, None] == labels).mean()))
        # What has more to fit must earn it.
        first_type = mixtures[0].covariance_type
        losses = [
            (1 - score) / (1 if mixture.covariance_type == first_type else EARNED)
            for score, mixture in zip(scores, mixtures, strict=True)
        ]
        best = int(np.argmin(losses))
        self.mixture_, self.grouping_ = mixtures[best], groupings[best]
        scattered = np.zeros(len(self.mixture_.weights), dtype=bool)
        for _ in range(REGROUPED):
            lasting = self._lasting(poses)
            if lasting.all():
                break
            scattered |= ~lasting[self.grouping_.groups(len(lasting))]
            self.grouping_ = Grouping.of(means[best], scattered)

    def _lasting(self, poses: Sequence[PoseSignature]) -> BoolArray:
        """(n_segments_,) whether a segment has a part in most poses that is no crumb."""
        seen = np.zeros(self.n_segments_)
        for pose in poses:
            original = pose.surface.original
            smooth = smooth_posteriors(pose.surface.mesh, self._posteriors(pose), SMOOTHING_LENGTH)
            labels = pose.surface.to_faces(smooth).argmax(axis=1)
            region = connected_regions(labels, FaceAdjacency.of(pose.surface.welded_faces, original.vertices))
            large = np.bincount(region, original.face_areas) >= MIN_SHARE * original.area
            seen[np.unique(labels[large[region]])] += 1
        return np.asarray(seen >= len(poses) / 2)

    def _least_components(self) -> int:
        return 2 if isinstance(self.n_segments, str) else self.n_segments

    def _number(self, grouping: Grouping) -> int:
        return grouping.best_number() if isinstance(self.n_segments, str) else self.n_segments

    @property
    def n_segments_(self) -> int:
        """Segments of the fitted model."""
        mixture = self._fitted()
        return len(mixture.weights) if self.grouping_ is None else self._number(self.grouping_)

    def _posteriors(self, pose: PoseSignature) -> FloatArray:
        """(n', n_segments_) sums of the posteriors of each segment's components."""
        posteriors = self._fitted().posteriors(self._standardised(pose.signature))
        if self.grouping_ is None:
            return posteriors
        group = self.grouping_.groups(self.n_segments_)
        return np.asarray(posteriors @ np.eye(self.n_segments_, dtype=posteriors.dtype)[group])

    @threadpool_limits.wrap(limits=1, user_api="blas")  # on arrays this small, threads wait for each other
    def _clean(
        self,
        poses: Sequence[PoseSignature],
        polygons: Sequence[IntArray] | None,
        min_share: float | None,
        progress: Callable[[float], None] | None = None,
        marked: IntArray | None = None,
    ) -> tuple[IntArray, FaceAdjacency]:
        """Labels of polygons (None: each triangle is one) from the mean posterior of all poses, and neighbours."""
        length = self._setting("smoothness") * SMOOTHING_LENGTH
        least = self._least_share(min_share)
        if polygons is None:
            polygons = [np.arange(pose.surface.original.n_faces) for pose in poses]
        n_polygons = 1 + max(int(polygon_of.max()) for polygon_of in polygons)
        posteriors = np.zeros((n_polygons, self.n_segments_))
        areas, poses_seen = np.zeros(n_polygons), np.zeros(n_polygons)
        layouts = []
        for pose, polygon_of in zip(poses, polygons, strict=True):
            surface, original = pose.surface, pose.surface.original
            sum_over = indicator(np.where(polygon_of < 0, n_polygons, polygon_of), n_polygons + 1)[:n_polygons]
            # A triangle without area still speaks, if very softly, or its polygon would have no label.
            weight = original.face_areas / original.area + np.finfo(float).eps
            total = sum_over @ weight
            seen = total > 0
            mean = diags(1 / np.where(seen, total, 1)) @ sum_over @ diags(weight)
            of_vertices = self._posteriors(pose)
            if length > 0:
                of_vertices = smooth_posteriors(surface.mesh, of_vertices, length)
            posteriors += mean @ surface.to_faces(of_vertices)
            areas += total * seen
            poses_seen += seen
            layouts.append(_Layout.of(surface, polygon_of, mean, length > 0))
            if progress:
                progress(len(layouts) / len(poses))
        # Of one mesh the borders are the same in every pose; modifiers may hide some of them in one.
        layout = max(layouts, key=lambda layout: len(layout.adjacency.pairs))
        others = sum(other.centres for other in layouts) / np.maximum(poses_seen, 1)[:, None]
        centres = np.where(layout.seen[:, None], layout.centres, others)
        areas /= np.maximum(poses_seen, 1)
        posteriors /= np.maximum(poses_seen, 1)[:, None]
        labels = np.where(poses_seen > 0, posteriors.argmax(axis=1), -1)
        adjacency = layout.adjacency
        if length > 0:
            weights = layout.weights
            if marked is not None:
                weights = np.where(adjacency.among(marked), MARKED * weights, weights)
            labels = cut_borders(posteriors, areas, centres, adjacency, weights, length, labels)
        return merge_crumbs(labels, areas, centres, adjacency, least)


def _alike(poses: Sequence[PoseSignature]) -> bool:
    """Whether several poses are of one mesh."""
    faces = [pose.surface.original.faces for pose in poses]
    return len(poses) > 1 and all(np.array_equal(faces[0], other) for other in faces[1:])


@dataclass(frozen=True)
class _Layout:
    """Where the p polygons of a mesh lie in one pose, of area 1.

    Attributes
    ----------
    seen : (p,) bool array
        Whether any triangle is of the polygon.
    centres : (p, 3) array
        0 where not seen.
    adjacency : FaceAdjacency
        Of the polygons.
    weights : (b,) array
        What each border costs by its length, see `crease_weights`.
    """

    seen: BoolArray
    centres: FloatArray
    adjacency: FaceAdjacency
    weights: FloatArray

    @classmethod
    def of(cls, surface: Surface, polygon_of: IntArray, mean: csr_matrix, weighed: bool) -> _Layout:
        """Given the polygon of each triangle and the (p, m) mean of triangles over each polygon."""
        original = surface.original
        unit = np.sqrt(original.area)
        adjacency = FaceAdjacency.of(surface.welded_faces, original.vertices / unit)
        across = adjacency.across(polygon_of)
        weights = crease_weights(surface, adjacency) if weighed else np.ones(len(adjacency.lengths))
        centres = np.asarray(mean @ (original.vertices[original.faces].mean(axis=1) / unit))
        seen = np.asarray(mean.sum(axis=1)).ravel() > 0
        return cls(seen, centres, adjacency.between_polygons(polygon_of), weights[across])
