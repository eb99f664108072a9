"""Segments that are the same in every pose: parts by shape and motion, recognized by one mixture of their signatures.

Aubry, Schlickewei and Cremers, "Pose-consistent 3D shape segmentation based on a quantum mechanical feature
descriptor" (2011).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from copy import copy
from functools import partial
from os import PathLike
from typing import Any, Literal

from . import model_file
from .labeling.pose_labeling import PoseLabeling
from .labeling.recognized_parts import recognized_parts
from .labeling.region_atlas import RegionAtlas
from .labeling.taught_labels import learned_lesson, lesson_of
from .learning.gaussian_mixture import CovarianceType
from .learning.likelihood import comparable_score, usual_scores
from .learning.parameters import Estimator, NSegments, Preset, check_parameters, effective
from .learning.part_mixture import PartMixture, learn_parts
from .learning.standardizer import Scaling, Standardizer
from .learning.taught_mixture import learn_taught_parts
from .learning.training_samples import TrainingSamples
from .mesh.surface import IslandMode
from .mesh.triangle_mesh import FloatArray, IntArray, TriangleMesh
from .message import Message
from .poses.arguments import as_list
from .poses.pose_cache import AnyPose
from .poses.signature_cache import Cache
from .progress import Progress, ReportFunction
from .spectral.eigenpairs import Accuracy
from .spectral.intrinsic_delaunay import Laplacian
from .spectral.laplacian import unit_area_masses
from .threads import one_blas_thread, one_thread
from .user_labels import PartNotes, Unlabeled

GROUPED, RECOGNIZED = 0.75, 0.94
"""Shares of the time of learning from described poses after which the parts are found and merged, and their regions
are known: means of five characters."""


class PoseSegmentation(PoseLabeling, Estimator):
    """Learns the segments of a character from several poses and finds them in any pose.

    An estimator as scikit-learn has them: parameters are checked by `fit`, whose results are attributes with a trailing
    underscore.

        model = PoseSegmentation(n_segments=8).fit(meshes)
        labels = model.segment_faces(another_mesh)

    Parameters
    ----------
    n_segments : int or "auto"
        Number of segments, where left and right count as one. A segment is a group of kinds of parts, each of which is
        a group of components of the mixture; with the paper's setting, each component is a segment. "auto": as many as
        there are distinct parts, see `MergeTree.natural`; not with the paper's setting.
    covariance_type : "auto", "shared", "diag", "full", "tied" or "spherical"
        "shared" is one diagonal covariance for all components, which the paper proposes; "tied" is one full matrix for
        all, which fits poses of one mesh more closely, but over-fits on several bodies. "auto" is "tied" if all poses
        are of one mesh, and "diag" on several. "full" has one component for each kind of part.
    n_eigenpairs : int
        Number of eigenpairs of each pose, not counting the zero modes of further islands.
    n_energies : int
        Length of the signature.
    accuracy : "fast" or "exact"
        See `eigenpairs`.
    random_state : int
        Seed of the single k-means start in the paper's setting. Nothing else is random.
    scaling : "log" or "raw"
        What enters the mixture: the logarithm of the signature, so that fine parts do not outweigh limbs, or the
        signature itself, as in the paper.
    pieces : "joined" or "separate"
        Whether islands are tied to what they are nearest to, so that they are segmented together, or stay separate.
    laplacian : "auto", "cotangent" or "delaunay"
        The paper's cotangents on the triangles of the mesh, or on intrinsic Delaunay triangles between the same
        vertices (`delaunay`); "auto" takes the triangles of the mesh unless many of them are slivers.
    smoothness : float
        How smooth borders are. At 0 each vertex keeps the label of its own signature, and the default `min_share` is 0.
    preset : "default" or "paper"
        "paper" overrides `covariance_type`, `scaling`, `laplacian` and `smoothness` by the setting of the paper.

    Attributes
    ----------
    mixture_ : GaussianMixture
        Mixture of standardized signatures, with K components.
    standardizer_ : Standardizer
        Fitted to the signatures of the learned poses.
    centre_, spread_ : (n_energies,) arrays
        Mean and standard deviation of the scaled training signatures over the area.
    grouping_ : MergeTree or None
        Order in which components are merged into kinds of parts, and these into segments; None with the paper's
        setting.
    of_bodies_ : bool
        Whether several meshes were learned: a mesh is then cut by its own shape, and each of its regions gets one kind.
    taught_ : TaughtParts or None
        Which segments are taught parts, if `fit` was given labels: the first `taught_.n_parts` ones.
    plan_ : BodyPlan or None
        Where taught parts lie in the plan of a body, if they were taught on at least three that are symmetric: on
        others that are, it tells the parts together with their signatures.
    regions_ : RegionAtlas or None
        Connected regions of the learned poses; None with the paper's setting.
    sides_ : RegionAtlas or None
        Connected regions of the segments, which can be smaller than `regions_`: they tell left from right.
    n_segments_ : int
        Number of segments.
    usual_scores_ : (poses,) array
        Estimate of each learned pose's `comparable_score` under a model learned without it; for a single pose, the
        score that it has.
    part_notes_ : PartNotes
        Names and colors that a user gave to parts, and which parts are merged; only kept with the model.

    Examples
    --------
    >>> from examples.tube import tube
    >>> from wks_segment.core import PoseSegmentation
    >>> model = PoseSegmentation(n_segments=2, n_eigenpairs=40).fit([tube(0.2), tube(0.8), tube(1.4)])
    >>> labels = model.segment_faces(tube(1.1))  # a pose that was never seen
    >>> labels.shape, len(set(labels.tolist()))
    ((576,), 2)
    >>> model.predict_soft(tube(1.1)).sum(axis=1).round(6).min().item()
    1.0
    >>> model.with_segments(1).n_segments_
    1
    """

    usual_scores_: FloatArray
    part_notes_: PartNotes

    def __init__(
        self,
        n_segments: NSegments = 8,
        covariance_type: Literal["auto"] | CovarianceType = "auto",
        n_eigenpairs: int = 300,
        n_energies: int = 100,
        accuracy: Accuracy = "fast",
        random_state: int = 0,
        scaling: Scaling = "log",
        pieces: IslandMode = "joined",
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

    @one_thread  # k-means included: the same digits with any number of threads
    def fit(
        self,
        meshes: Iterable[AnyPose],
        progress: ReportFunction | Progress | None = None,
        rest: TriangleMesh | None = None,
        cache: Cache | None = None,
        labels: Sequence[IntArray | None] | None = None,
        unlabeled: Unlabeled = "learn",
    ) -> PoseSegmentation:
        """Learn the segments from one or more poses together, or the parts given by `labels`.

        Parameters
        ----------
        meshes
            The poses, which need not have the same mesh. Each has the same weight, whatever its size and number of
            vertices. A single pose is allowed, but cannot show what changes from pose to pose.
        progress
            Called with the stage and the share of the work that is done, 0 to 1. An error that it raises ends the work
            and leaves the model as it was.
        rest : TriangleMesh, optional
            The mesh of the first pose in its rest position, where +x is the left of the character, as in Blender and
            glTF: it tells left from right. If not given, the first pose does.
        cache : Cache, optional
            Searched for signatures, creases and kinds of parts; new ones are added to it. A fit to the same poses with
            another number of segments then takes a fraction of the time, as long as the number of regions of the mesh
            (see `with_segments`) is the same. The result is exactly the same as without a cache.
        labels : sequence of int arrays or None, optional
            To teach parts: for each mesh an (m,) array with the part of each face (0, 1, … without gaps; -1 for no
            part), or None if no face of the mesh has a part. Segments get these numbers; left and right are two parts.
        unlabeled : "learn" or "ignore"
            What becomes of faces without a part (-1). "learn": they are cut as usual into as many segments as
            `n_segments` has beyond the taught parts, at least one, numbered after these. "ignore": nothing is learned
            from them, and each gets the taught part that fits it best.

        Raises
        ------
        ValueError
            If there is no pose, a parameter is out of range, there are fewer vertices than segments, or `rest` has
            other faces than the first pose; if labels do not fit, or with the paper's setting.
        UnlikePartsError
            If two taught parts cannot be told apart (a ValueError).
        SpectrumError, MemoryError
            If the eigenpairs of a pose could not be computed; see `describe`.
        """
        self._check_parameters()
        meshes = as_list(meshes, "meshes")
        if not meshes:
            raise ValueError("there is no pose to learn from: pass at least one mesh, better three to five")
        overall, parameters = Progress.of(progress), self.get_params()
        lesson = None if labels is None else lesson_of(labels, meshes, unlabeled, self.preset)
        poses, described = self._all_described(meshes, overall, cache)
        overall = overall.part(described, 1.0)
        overall(0.0, "parts")
        training = TrainingSamples.of(poses, parameters)
        labeler_of = partial(self._labeler_of, standardizer=training.standardizer)
        atlases = None
        if lesson is not None:
            learn = partial(learn_taught_parts, parameters, poses, training=training, rest=rest, cache=cache)
            learned, atlases = learned_lesson(lesson, learn, labeler_of, poses, rest, overall.part(0.0, RECOGNIZED))
        else:
            learned = learn_parts(parameters, poses, training, rest, cache, overall.part(0.0, GROUPED))
            if learned.grouping is not None:
                step = overall.part(GROUPED, RECOGNIZED)
                learned, atlases = recognized_parts(labeler_of, learned, poses, rest, step)
        self._set_learned(learned, training.standardizer, atlases, usual_scores(learned, training))
        self.part_notes_ = PartNotes()
        overall(1.0, "done")
        return self

    @one_blas_thread
    def score(self, mesh: AnyPose) -> float:
        """Mean log-likelihood of the signature over the area: how well the model explains a shape (section 5).

        Comparable between models with the same number of energies and the same scaling; see `comparable_score`.
        """
        mixture, pose = self._fitted(), self._described(mesh)
        masses = unit_area_masses(pose.surface.mesh)
        likelihoods = mixture.log_likelihoods(self.standardizer_.transform(pose.signature))
        return float(masses @ likelihoods / masses.sum() - self.standardizer_.log_volume)

    @one_blas_thread
    def comparable_score(self, mesh: AnyPose) -> float:
        """How well the model explains a shape, comparable between all models: for `rank`.

        Like `score`, but without the least likely tenth of the area, per energy, and as a density of the logarithm of
        the signature, whatever the scaling. Of a covariance "tied" only the variances count, but with the paper's
        setting.
        """
        pose = self._described(mesh)
        mixture = self._learned().for_ranking(self._fitted())
        likelihoods = mixture.log_likelihoods(self.standardizer_.transform(pose.signature))
        masses = unit_area_masses(pose.surface.mesh)
        return comparable_score(self.standardizer_, likelihoods, pose.signature, masses / masses.sum())

    @one_blas_thread
    def with_segments(
        self,
        n_segments: NSegments,
        poses: Iterable[AnyPose] = (),
        rest: TriangleMesh | None = None,
    ) -> PoseSegmentation:
        """A copy of the model with another number of segments, at once: its components merged into as many groups.

        A new fit gives the same segments as long as it cuts the meshes into as many regions and kinds of parts, and
        makes as many components: on one mesh for up to 15 segments (`n_regions_of_mesh`), on several for up to 8
        (`n_kinds_of_bodies`). For more, a new fit looks for finer parts. With more segments than kinds of parts, kinds
        are split by their signatures.

        Parameters
        ----------
        n_segments : int or "auto"
            As for a new model, but at most the number of components.
        poses : sequence of PoseSignature, optional
            The learned poses, as `describe_all` gives them together. `segment_regions` then finds the regions of the
            new segments; without them it finds the learned ones, which also serve `polygon_sides`.
        rest : TriangleMesh, optional
            As for `fit`.

        Raises
        ------
        ValueError
            If there are fewer components, or the model has the paper's setting, where each component is a segment.
        """
        n_components = len(self._fitted().weights)
        if self.grouping_ is None:
            raise ValueError("with the paper's setting each component is a segment: fit a new model for another number")
        if n_segments != "auto" and n_segments > n_components:
            raise ValueError(
                Message(
                    "n_segments is {segments}, but the model has {count} components: fit a new model for more",
                    segments=n_segments,
                    count=n_components,
                )
            )
        model = copy(self)
        model.n_segments = n_segments
        model._check_parameters()
        poses = as_list(poses, "poses")
        if poses:
            known = [atlas for atlas in (self.regions_, self.sides_) if atlas is not None]
            described = [model._described(pose) for pose in poses]
            model.regions_, sides = model._labeler().atlases(described, rest, Progress(), known)
            # Sides of taught parts were taught.
            model.sides_ = sides if self.taught_ is None else self.sides_
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
            If the file is not a model, damaged, or of another version (a ValueError).
        OSError
            If the file cannot be read.
        """
        return cls.from_json(model_file.read(path))

    def to_json(self) -> str:
        """The fitted model as JSON text; ValueError if it is not fitted."""
        learned, atlases = self._learned(), None
        if self.regions_ is not None and self.sides_ is not None:
            atlases = self.regions_, self.sides_
        return model_file.encode(
            model_file.ModelContent(
                self.get_params(), learned, self.standardizer_,
                atlases, self.usual_scores_, self.part_notes_,
            )
        )  # fmt: skip

    @classmethod
    def from_json(cls, text: str) -> PoseSegmentation:
        """The model in JSON text; ModelFileError if there is none."""
        content = model_file.decode(text)
        model = cls(**content.parameters)
        model._set_learned(content.learned, content.standardizer, content.atlases, content.usual_scores)
        model.part_notes_ = content.part_notes
        return model

    @property
    def centre_(self) -> FloatArray:
        """(n_energies,) mean of the scaled training signatures over the area."""
        return self.standardizer_.mean

    @property
    def spread_(self) -> FloatArray:
        """(n_energies,) standard deviation of the scaled training signatures over the area."""
        return self.standardizer_.spread

    def _learned(self) -> PartMixture:
        """What was learned of the parts; NotFittedError if nothing was."""
        return PartMixture(self._fitted(), self.grouping_, self.of_bodies_, self.taught_, self.plan_)

    def _set_learned(
        self,
        learned: PartMixture,
        standardizer: Standardizer,
        atlases: tuple[RegionAtlas, RegionAtlas] | None,
        scores: FloatArray,
    ) -> None:
        self.mixture_, self.standardizer_ = learned.mixture, standardizer
        self.grouping_, self.of_bodies_ = learned.grouping, learned.of_bodies
        self.taught_, self.plan_ = learned.taught, learned.plan
        self.regions_, self.sides_ = atlases or (None, None)
        self.usual_scores_ = scores

    def _check_parameters(self) -> None:
        check_parameters(self.get_params())

    def _effective(self, name: str) -> Any:
        """Value of a parameter after the preset."""
        return effective(self.get_params(), name)

    def _laplacian(self) -> Literal["auto"] | Laplacian:
        laplacian: Literal["auto"] | Laplacian = self._effective("laplacian")
        return laplacian
