"""Parts that are the same in every pose: one Gaussian mixture over the signatures of several poses.

Aubry, Schlickewei and Cremers, "Pose-consistent 3D shape segmentation based on a quantum mechanical feature
descriptor" (2011).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from os import PathLike
from typing import Any, Literal, get_args

import numpy as np
from threadpoolctl import threadpool_limits

from . import model_file
from .labeling.labeler import Labeler
from .labeling.region_atlas import RegionAtlas
from .learning.candidates import SMOOTHING_LENGTH
from .learning.gaussian_mixture import CovarianceType, GaussianMixture, drawn_evenly, fit_mixtures
from .learning.likelihood import left_out_likelihoods, likely_mean
from .learning.merge_tree import Grouping
from .learning.model_selection import AUTO, Candidates, Plan
from .mesh.adjacency import connected_regions
from .mesh.surface import Pieces
from .mesh.triangle_mesh import FloatArray, IntArray, TriangleMesh
from .poses.describe import PoseDescriber, Progress
from .poses.pose_cache import Workpiece
from .poses.pose_signature import PoseSignature
from .poses.signature_cache import Cache
from .spectral.eigenpairs import Accuracy
from .spectral.intrinsic_delaunay import Laplacian
from .spectral.laplacian import unit_area_masses
from .user_labels import PartNotes

Scaling = Literal["log", "raw"]
Preset = Literal["default", "paper"]
AnyPose = TriangleMesh | PoseSignature | Workpiece
"""A pose as methods take it: the more is known of it, the less is to be computed."""

DESCRIBED = 0.2
"""Share of the work that is signatures."""
MIXED = 0.5
"""Share of the work when the mixture is fitted."""
GROUPED = 0.9
"""Share of the work when its components are grouped."""
SIGNATURE_OFFSET = 1.0
"""Added to the signature, whose mean is 1, before its logarithm: smaller values change much from pose to pose and say
little, and tiny loose parts take no part in low energies."""
MOST_SMOOTHNESS = 10
MAX_SAMPLES = 20_000
"""Vertices that take part in the mixture, spread evenly by area where there are more."""
PAPER: dict[str, Any] = {
    "covariance_type": "diag", "scaling": "raw", "laplacian": "cotangent", "smoothness": 0.0,
}  # fmt: skip
"""What `preset="paper"` means: a mixture of the signatures themselves, started once, and its components as labels."""


class PoseSegmentation(PoseDescriber):
    """Learns a character's parts from several poses and finds them in any pose.

    Parameters
    ----------
    n_segments : int or "auto"
        Parts to find, where left and right count as one. A segment is a group of components of the mixture; with the
        paper's setting each component is one. "auto": as many as are nearly as certain as any number, see
        `Grouping.best_number`; not for the paper's setting.
    covariance_type : "auto", "shared", "diag", "full", "tied" or "spherical"
        "shared" is one diagonal covariance for all components, the paper's remark and the most robust on bodies that
        were not learned from. "auto" tries "diag", too: on poses of one mesh its labels must agree far better between
        these, on several bodies its regions must be more like what creases cut. "tied" and "full" have one component a
        segment.
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
        In the space of centered and scaled signatures, with K components.
    grouping_ : Grouping or None
        In which order components make segments; None with the paper's setting.
    regions_ : RegionAtlas or None
        The connected regions of the learned poses; None with the paper's setting.
    sides_ : RegionAtlas or None
        The same of the segments, which may be smaller than regions: by these left and right are told.
    n_segments_ : int
        Segments found.
    centre_, spread_ : (n_energies,) arrays
        Mean and standard deviation of the training signatures over the area.
    usual_scores_ : (poses,) array
        About what `comparable_score` would give for each learned pose, had it not been learned; of one pose alone, what
        it gives.
    part_notes_ : PartNotes
        Names and colors that a user gave the parts, and which are one: kept with the model, and no more.
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

    def fit(
        self,
        meshes: Sequence[AnyPose],
        progress: Progress | None = None,
        rest: TriangleMesh | None = None,
        cache: Cache | None = None,
    ) -> PoseSegmentation:
        """Learn the parts from one or more poses together.

        Parameters
        ----------
        meshes
            The poses; they need not share their meshing. Each counts the same, whatever its size and number of
            vertices. One pose alone is allowed, but says nothing of what a pose changes.
        progress
            Called while the poses are described and the mixture is fitted.
        rest : TriangleMesh, optional
            The mesh of the first pose at rest, in front of which x points to the character's left, as in Blender and
            glTF: left and right are told there. In the first pose if not given.
        cache : Cache, optional
            Asked first for what takes the time, and told in the end: a fit to the same poses with another number of
            segments then takes a fraction of it, and gives the very same as without.

        Raises
        ------
        ValueError
            If there is no pose, a parameter is out of range, there are fewer vertices than segments, or `rest` has
            other faces than the first pose.
        SpectrumError, MemoryError
            If the eigenpairs of a pose could not be computed; see `describe`.
        """
        self._check_parameters()
        if not len(meshes):
            raise ValueError("there is no pose to learn from: pass one mesh at least, better three to five")
        tick = progress or (lambda stage, share: None)
        new = {i: mesh for i, mesh in enumerate(meshes) if isinstance(mesh, TriangleMesh)}
        found = self.describe_all(
            list(new.values()), None, lambda stage, share: tick(stage, DESCRIBED * share), cache=cache
        )
        described = dict(zip(new, found, strict=True))
        works = [self._work(described.get(i, mesh)) for i, mesh in enumerate(meshes)]
        poses = [work.pose for work in works]
        tick("mixture", DESCRIBED)
        weights = np.concatenate([unit_area_masses(pose.surface.mesh) for pose in poses])
        if self._least_components() > len(weights):
            raise ValueError(f"n_segments is {self.n_segments}, but the poses have only {len(weights)} vertices")
        shares = weights / weights.sum()
        group = np.repeat(np.arange(len(poses)), [len(pose.signature) for pose in poses])
        signatures = [pose.signature for pose in poses]
        if len(shares) > MAX_SAMPLES:
            drawn = drawn_evenly(shares, MAX_SAMPLES)
            starts = np.cumsum([0, *(len(signature) for signature in signatures)])
            first = np.searchsorted(drawn, starts)
            signatures = [
                signature[drawn[first[i] : first[i + 1]] - starts[i]] for i, signature in enumerate(signatures)
            ]
            shares, group = np.full(MAX_SAMPLES, 1 / MAX_SAMPLES), group[drawn]
        signature = np.concatenate(signatures)
        samples = self._scaled(signature).astype(np.float64)
        samples = self._centered(samples, shares)

        def mixing(share: float) -> None:
            tick("mixture", DESCRIBED + (MIXED - DESCRIBED) * share)

        def grouping(share: float) -> None:
            tick("parts", MIXED + (GROUPED - MIXED) * share)

        def naming(share: float) -> None:
            tick("regions", GROUPED + (1 - GROUPED) * share)

        wanted, covariance_type = self._least_components(), self._setting("covariance_type")
        self.part_notes_ = PartNotes()
        self.grouping_: Grouping | None = None
        self.regions_: RegionAtlas | None = None
        self.sides_: RegionAtlas | None = None
        if self.preset == "paper":
            (self.mixture_,) = fit_mixtures(samples, shares, wanted, covariance_type, self.random_state, 1, mixing)
        else:
            types = AUTO[: len(poses)] if covariance_type == "auto" else (covariance_type,)
            plan = Plan(poses, samples, shares, wanted, types, self.n_segments == "auto")
            layout = plan.laid_out(self._standardized, [self._setting("scaling")], cache, mixing, grouping)
            self.mixture_, self.grouping_ = Candidates(layout, self._number).best()
            self._learn_regions(works, rest, naming)
        self.usual_scores_ = self._usual_scores(samples, signature, shares, group)
        tick("done", 1.0)
        return self

    def predict(self, mesh: AnyPose) -> IntArray:
        """(n,) segment of each vertex: the one with the highest posterior, as in the paper."""
        return np.asarray(self.predict_proba(mesh).argmax(axis=1))

    def predict_proba(self, mesh: AnyPose) -> FloatArray:
        """(n, n_segments) posterior of each segment at each vertex; rows sum to 1."""
        labeler, work = self._labeler(), self._work(mesh)
        return work.surface.to_vertices(labeler.joined(labeler.posteriors(work)))

    @threadpool_limits.wrap(limits=1, user_api="blas")  # on arrays this small, threads wait for each other
    def predict_soft(self, mesh: AnyPose) -> FloatArray:
        """(n, n_segments) posteriors as `predict_proba` has them, smoothed as far as the labels of faces are."""
        labeler, work = self._labeler(), self._work(mesh)
        posteriors = labeler.smoothed(work, labeler.n_segments)
        if self._setting("smoothness") > 0:
            # Obtuse triangles let the heat flow a little beyond 0 and 1.
            posteriors = np.clip(posteriors, 0, 1).astype(np.float64)
            posteriors /= posteriors.sum(axis=1, keepdims=True)
        return work.surface.to_vertices(posteriors)

    def score(self, mesh: AnyPose) -> float:
        """Mean log-likelihood of the signature over the area: how well the model explains a shape (section 5).

        Comparable between models with the same number of energies and the same scaling; see `comparable_score`.
        """
        mixture = self._fitted()
        pose = self._work(mesh).pose
        likelihoods = mixture.log_likelihoods(self._standardized(pose.signature))
        masses = unit_area_masses(pose.surface.mesh)
        return float(masses @ likelihoods / masses.sum() - self._log_unit())

    def comparable_score(self, mesh: AnyPose) -> float:
        """How well the model explains a shape, comparable between all models: for `rank`.

        As `score`, but without the least likely tenth of the area, per energy, and as a density of the logarithm of the
        signature whatever enters the mixture.
        """
        pose = self._work(mesh).pose
        likelihoods = self._fitted().log_likelihoods(self._standardized(pose.signature))
        masses = unit_area_masses(pose.surface.mesh)
        return self._comparable(likelihoods, pose.signature, masses / masses.sum())

    def segment_faces(self, mesh: AnyPose, min_share: float | None = None) -> IntArray:
        """(m,) component of each face, cleaned: smooth borders, no connected part under `min_share` of the area.

        `min_share` is 0.005 if not given, and 0 without smoothing. Unless it is 0, no part is under 15 % of the largest
        one of its segment either.
        A loose piece that is smaller as a whole takes the label of what is next to it.
        """
        return self._labeler().clean([self._work(mesh)], None, self._least_share(min_share))[0]

    def segment_regions(self, mesh: AnyPose, min_share: float | None = None) -> IntArray:
        """(m,) connected part of each face: left and right hand are two.

        Region i of one pose is region i of every other, on any meshing: as `regions_` has them, and numbered on from
        there for what was not learned; a pose may lack one. They are connected parts of segments, of which those whose
        common border is long for their areas are one here: as whole as people see them. With the paper's setting the
        connected parts of the components, in the order of these. Parts under `min_share` of the area belong to the
        part next to them.
        """
        labeler, work, least_share = self._labeler(), self._work(mesh), self._least_share(min_share)
        if self.regions_ is None:
            return connected_regions(*labeler.clean([work], None, least_share))
        return labeler.named_regions(self.regions_, work, least_share)

    def segment_polygons(
        self,
        poses: Sequence[AnyPose],
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
            Neighboring polygons between which a border is welcome, as at hard edges, seams and borders of materials:
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
        works = self._posed(poses, polygons)
        return self._labeler().clean(works, polygons, self._least_share(min_share), progress, marked)[0]

    def polygon_sides(
        self,
        poses: Sequence[AnyPose],
        polygons: Sequence[IntArray],
        labels: IntArray,
        progress: Callable[[float], None] | None = None,
    ) -> IntArray:
        """Tell left from right where a segment lies on both sides.

        Parameters
        ----------
        poses, polygons, progress
            As for `segment_polygons`. A few of the poses vote.
        labels : (p,) int array
            What `segment_polygons` gave.

        Returns
        -------
        (p,) int array: 1 for polygons of a part on the left that has one opposite, -1 for those on the right, 0 for
        others. All 0 with the paper's setting.

        Raises
        ------
        ValueError
            As by `segment_polygons`.
        """
        works = self._posed(poses, polygons)
        if self.sides_ is None:
            return np.zeros(len(labels), dtype=np.int64)
        return self._labeler().sides(self.sides_, works, polygons, labels, progress)

    def with_segments(
        self,
        n_segments: int | Literal["auto"],
        poses: Sequence[AnyPose] = (),
        rest: TriangleMesh | None = None,
    ) -> PoseSegmentation:
        """The same model with another number of segments, at once: its components joined to as many groups.

        Not what a new fit gives: that makes more components for more than eight segments, takes the mixture whose
        groups agree best at this number, and joins segments that are only crumbs at it. From eight to fewer segments
        labels are much the same, to more they are others: docs/method.md has numbers.

        Parameters
        ----------
        n_segments : int or "auto"
            As for a new model, but no more than components.
        poses, optional
            Those that were learned from. `segment_regions` then has the regions of the new segments; without them it
            has those that were learned, which serve `polygon_sides` as well.
        rest : TriangleMesh, optional
            As for `fit`.

        Raises
        ------
        ValueError
            If there are fewer components, or the model is of the paper's setting, where each is one segment.
        """
        n_components = len(self._fitted().weights)
        if self.grouping_ is None:
            raise ValueError("with the paper's setting each component is a segment: fit a new model for another number")
        if n_segments != "auto" and n_segments > n_components:
            raise ValueError(
                f"n_segments is {n_segments}, but the model has {n_components} components: fit a new model for more"
            )
        model = copy(self)
        model.n_segments = n_segments
        model._check_parameters()
        if len(poses):
            model._learn_regions([self._work(pose) for pose in poses], rest, lambda share: None)
        return model

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
            "covariances": mixture.covariances, "usual_scores": self.usual_scores_,
        }  # fmt: skip
        if self.grouping_ is not None:
            arrays["joins"] = self.grouping_.pairs
            arrays |= {name: getattr(self.grouping_, name) for name in ("certainties", "by_chance", "cuts")}
        if self.regions_ is not None and self.sides_ is not None:
            arrays |= self.regions_.arrays("region") | self.sides_.arrays("sided")
        return model_file.encode(
            {name: getattr(self, name) for name in model_file.PARAMETERS},
            arrays,
            mixture.covariance_type,
            self.part_notes_,
        )

    @classmethod
    def from_json(cls, text: str) -> PoseSegmentation:
        """The model in JSON text; ModelFileError if it is none."""
        parameters, arrays, covariance_type, notes = model_file.decode(text)
        model = cls(**parameters)
        model.part_notes_ = notes
        try:
            model._check_parameters()
        except (ValueError, TypeError) as error:
            raise model_file.ModelFileError(f"the model has a bad parameter: {error}") from error
        model.centre_, model.spread_ = arrays["centre"], arrays["spread"]
        model.usual_scores_ = arrays["usual_scores"]
        model.grouping_ = model.regions_ = model.sides_ = None
        if "joins" in arrays:
            joins = arrays["joins"].astype(np.int64)
            model.grouping_ = Grouping(joins, arrays["certainties"], arrays["by_chance"], arrays["cuts"])
            model.regions_, model.sides_ = (RegionAtlas.of_arrays(arrays, kind) for kind in model_file.KINDS)
        model.mixture_ = GaussianMixture(covariance_type, arrays["weights"], arrays["means"], arrays["covariances"])
        return model

    def _posed(self, poses: Sequence[AnyPose], polygons: Sequence[IntArray]) -> list[Workpiece]:
        """Poses of one mesh; ValueError if there are none, or polygons do not fit."""
        self._fitted()
        works = [self._work(pose) for pose in poses]
        if not works or len(works) != len(polygons):
            raise ValueError(f"there are {len(works)} poses, but polygons for {len(polygons)}")
        for i, (work, polygon_of) in enumerate(zip(works, polygons, strict=True)):
            if np.shape(polygon_of) != (work.surface.original.n_faces,):
                raise ValueError(
                    f"pose {i} has {work.surface.original.n_faces} triangles, but polygons for {np.shape(polygon_of)}"
                )
        return works

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
            return self._labeler().least_share
        if not 0 <= min_share < 1:
            raise ValueError(f"min_share must be from 0 to below 1, not {min_share!r}")
        return min_share

    def _laplacian(self) -> Literal["auto"] | Laplacian:
        laplacian: Literal["auto"] | Laplacian = self._setting("laplacian")
        return laplacian

    def _setting(self, name: str) -> Any:
        """What holds for a parameter that the preset may override."""
        return PAPER[name] if self.preset == "paper" else getattr(self, name)

    def _fitted(self) -> GaussianMixture:
        if not hasattr(self, "mixture_"):
            raise ValueError("the model is not fitted: call fit, or load a model, first")
        return self.mixture_

    def _work(self, mesh: AnyPose) -> Workpiece:
        pose = mesh.pose if isinstance(mesh, Workpiece) else mesh
        if isinstance(pose, TriangleMesh):
            return Workpiece(self.describe(pose))
        if not isinstance(pose, PoseSignature):
            raise TypeError(f"a pose must be a TriangleMesh or a PoseSignature, not {type(pose).__name__}")
        got = (pose.n_eigenpairs, pose.signature.shape[1])
        if got != (self.n_eigenpairs, self.n_energies):
            raise ValueError(
                f"the signature is of {got[0]} eigenpairs and {got[1]} energies, "
                f"the model of {self.n_eigenpairs} and {self.n_energies}"
            )
        return mesh if isinstance(mesh, Workpiece) else Workpiece(pose)

    def _scaled(self, signature: FloatArray) -> FloatArray:
        return np.log(signature + SIGNATURE_OFFSET) if self._setting("scaling") == "log" else signature

    @threadpool_limits.wrap(limits=1, user_api="blas")  # the same digits with any number of threads
    def _centered(self, samples: FloatArray, shares: FloatArray) -> FloatArray:
        """Learn the center and the spread of samples; the samples without them."""
        self.centre_ = shares @ samples
        self.spread_ = np.maximum(np.sqrt(shares @ (samples - self.centre_) ** 2), model_file.LEAST)
        if self.preset == "paper":
            self.spread_ = np.ones_like(self.spread_)
        return np.asarray((samples - self.centre_) / self.spread_)

    def _standardized(self, signature: FloatArray) -> FloatArray:
        scaled = self._scaled(signature)  # a new array, or the signature itself; in its own precision
        return np.asarray((scaled - self.centre_.astype(scaled.dtype)) / self.spread_.astype(scaled.dtype))

    def _log_unit(self) -> float:
        """To be taken from a log-density in standardized units: those of the signature are what models share."""
        return float(np.log(self.spread_).sum())

    def _comparable(self, log_likelihoods: FloatArray, signature: FloatArray, shares: FloatArray) -> float:
        """See `comparable_score`; of log-densities in standardized units at vertices with shares of the area."""
        densities = log_likelihoods - self._log_unit()
        if self._setting("scaling") == "raw":
            densities = densities + np.log(signature + SIGNATURE_OFFSET).sum(axis=1)
        return likely_mean(densities, shares) / self.n_energies

    @threadpool_limits.wrap(limits=1, user_api="blas")  # as above
    def _usual_scores(
        self, samples: FloatArray, signature: FloatArray, shares: FloatArray, group: IntArray
    ) -> FloatArray:
        """See `usual_scores_`; of standardized samples of the signature, given which pose each is of."""
        poses = np.unique(group)
        if len(poses) > 1:
            likelihoods = left_out_likelihoods(self.mixture_, samples, shares, group)
        else:
            likelihoods = self.mixture_.log_likelihoods(samples)
        of_poses = [group == i for i in poses]
        return np.array(
            [self._comparable(likelihoods[of], signature[of], shares[of] / shares[of].sum()) for of in of_poses]
        )

    def _least_components(self) -> int:
        return 2 if isinstance(self.n_segments, str) else self.n_segments

    def _number(self, grouping: Grouping) -> int:
        return grouping.best_number() if isinstance(self.n_segments, str) else self.n_segments

    @property
    def n_segments_(self) -> int:
        """Segments of the fitted model."""
        mixture = self._fitted()
        return len(mixture.weights) if self.grouping_ is None else self._number(self.grouping_)

    def _length(self) -> float:
        """Smoothing length, in units of the square root of the area."""
        return float(self._setting("smoothness") * SMOOTHING_LENGTH)

    def _labeler(self) -> Labeler:
        """The fitted mixture with the settings as they are."""
        mixture = self._fitted()
        return Labeler(mixture, self.grouping_, self._standardized, self.n_segments_, self._length())

    def _learn_regions(
        self, works: Sequence[Workpiece], rest: TriangleMesh | None, tick: Callable[[float], None]
    ) -> None:
        """The connected regions of the learned poses: of wholes, and of the segments, if these are others.

        What is whole may lie on both sides: forelegs and the chest between them.
        """
        assert self.grouping_ is not None
        atlases = {atlas.n_groups: atlas for atlas in (self.regions_, self.sides_) if atlas is not None}
        numbers = self.grouping_.number_of_wholes(self.n_segments_), self.n_segments_
        new = sorted(set(numbers) - atlases.keys())
        for i, n_groups in enumerate(new):

            def of_atlas(share: float, begun: int = i) -> None:
                tick((begun + share) / len(new))

            atlases[n_groups] = self._labeler().atlas(n_groups, works, rest, of_atlas)
        self.regions_, self.sides_ = (atlases[n_groups] for n_groups in numbers)
