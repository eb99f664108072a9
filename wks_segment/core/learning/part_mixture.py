"""A mixture of the signatures inside each kind of part.

Signatures alone make bands of equal thickness, never a head or a finger. So the learned meshes are cut into parts
first, by everything that is known of them (`core/parts`), and the mixture only has to recognize these: several
components describe the signatures inside each kind of part.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from ..mesh.surface import shares_at_vertices
from ..mesh.triangle_mesh import FloatArray, IntArray, TriangleMesh
from ..message import Message, message_of
from ..parts.evidence import Evidence
from ..parts.kinds import Kinds, find_kinds, least_kinds_of_bodies, n_kinds_of_bodies, n_regions_of_mesh
from ..parts.part_graph import PartGraph
from ..poses.pose_cache import Workpiece, smooth_means
from ..poses.pose_signature import of_one_mesh
from ..poses.signature_cache import Cache, content_key
from ..progress import Progress
from .agreement import PER_KIND, agreed_kinds
from .body_plan import BodyPlan
from .gaussian_mixture import GaussianMixture, TooFewSamplesError, fit_mixture
from .inside_parts import fitted_inside
from .merge_tree import MergeTree
from .parameters import effective, least_segments
from .standardizer import Standardizer
from .taught_parts import TaughtParts
from .training_samples import TrainingSamples

KINDS_VERSION = 7
"""To be raised whenever the same poses and settings give other kinds than before."""
AXES, WHITENING, LEAST_VARIANCE = 20, 0.25, 1e-2
"""Number of principal axes of the signatures along which parts are compared, and the power of their variance, with a
little added, that they are divided by: later axes, which tell small parts apart, then count more, but less than the
first ones."""
COMPONENTS_OF_MESH, COMPONENTS_OF_POSE, PER_SEGMENT = 100, 40, 2
"""Number of components of the mixture of one mesh, but at most so many for each of its poses; and the least number for
each segment. With more, poses that were not learned are recognized worse, with fewer, parts are not kept
(docs/dev/experiments.md)."""
SMOOTHING_LENGTH = 0.03
"""Width of the smoothing along borders at smoothness 1, in units of the square root of the area."""
VANISHED = 0.5
"""A kind that keeps less than this share of its area when borders move is merged before all others."""
FOUND = 0.42
"""Share of the time of finding parts and fitting the mixture after which the kinds are found."""
FITTED, ASSIGNED = 0.33, 0.88
"""Shares of the time after that when the first mixture is fitted, and when the last one is. All four are means of five
characters."""
GROWN = 0.85
"""Share of the time of finding the kinds after which the graph of regions is known; growing them cannot report."""


@dataclass(frozen=True)
class PartMixture:
    """What is learned of the parts of some poses.

    Attributes
    ----------
    mixture : GaussianMixture
    grouping : MergeTree or None
        Order in which its components are merged into kinds of parts, and these into segments; None with the paper's
        setting.
    of_bodies : bool
        Whether kinds are those of several meshes: another mesh is then cut by its own shape, and its regions get kinds.
    taught : TaughtParts or None
        The first groups as parts that a user taught, if any.
    plan : BodyPlan or None
        Where these lie in the plan of a body, if at least three symmetric bodies were taught, and nothing else
        was learned.
    """

    mixture: GaussianMixture
    grouping: MergeTree | None
    of_bodies: bool = False
    taught: TaughtParts | None = None
    plan: BodyPlan | None = None

    def for_ranking(self, mixture: GaussianMixture) -> GaussianMixture:
        """A mixture of these parts as its densities tell which model fits a shape.

        Of several bodies one diagonal counts for all components: a variance of each would fit the learned bodies alone.

        A full covariance tells parts of one mesh apart, but between meshes its small eigenvalues, which are noise of
        the learned poses, outweigh everything else: variances alone count. The paper's setting is kept, and models of
        0.1.0, whose usual scores were computed with the covariance that they have.
        """
        if self.grouping is None or self.grouping.areas is None:
            return mixture
        if self.of_bodies and mixture.covariance_type == "diag":
            return GaussianMixture("shared", mixture.weights, mixture.means, mixture.weights @ mixture.covariances)
        return mixture.without_correlations()


def learn_parts(
    parameters: Mapping[str, Any],
    poses: Sequence[Workpiece],
    training: TrainingSamples,
    rest: TriangleMesh | None,
    cache: Cache | None,
    progress: Progress,
) -> PartMixture:
    """Find the parts of learned poses and fit a mixture to them; with the paper's setting, the mixture alone.

    Parameters
    ----------
    parameters
        Of the model.
    poses
        Of one mesh, with the same faces; otherwise each is another mesh.
    training : TrainingSamples
        Of the poses.
    rest : TriangleMesh or None
        The mesh of the first pose at rest.
    cache : Cache or None
        Searched for the kinds of parts; new ones are added to it.
    progress : Progress

    Raises
    ------
    TooFewSamplesError
        If there are fewer distinct signatures than segments.
    ValueError
        If `rest` has other faces than the first pose.
    """
    n_segments = least_segments(parameters["n_segments"])
    covariance_type = effective(parameters, "covariance_type")
    if parameters["preset"] == "paper":
        step, seed = progress.part(0.0, 1.0, "mixture"), parameters["random_state"]
        samples, shares = training.standardized, training.shares
        return PartMixture(fit_mixture(samples, shares, n_segments, covariance_type, seed, step), None)
    alone = len(poses) == 1 or of_one_mesh([pose.pose for pose in poses])
    meshes = [poses] if alone else [[pose] for pose in poses]
    axes = principal_axes(training)
    step = progress.part(0.0, FOUND, "parts")
    kinds, were_known = kinds_of(meshes, training, axes, n_segments, rest, cache, step)
    if covariance_type == "auto":
        covariance_type = "tied" if alone else "diag"
    usual = min(COMPONENTS_OF_MESH, COMPONENTS_OF_POSE * len(poses)) if alone else PER_KIND * kinds.count
    count = max(usual, PER_SEGMENT * n_segments)
    step = progress.part(0.0 if were_known else FOUND, 1.0, "mixture")
    kind_of_samples = _kinds_of_samples(kinds.of_faces, meshes, training, kinds.count)
    found = after = np.bincount(kind_of_samples, training.shares, kinds.count).astype(np.float64)
    mixture, kind = fitted_inside(training, kind_of_samples, axes, count, covariance_type)
    if alone:
        step(FITTED)
        moved = _mean_posteriors(poses, training.standardizer, mixture, kind, kinds.count).argmax(axis=1)
        kind_of_samples = _kinds_of_samples([moved], meshes, training, kinds.count)
        after = np.bincount(kind_of_samples, training.shares, kinds.count).astype(np.float64)
        mixture, kind = fitted_inside(training, kind_of_samples, axes, count, covariance_type)
    if len(mixture.weights) < n_segments:
        raise TooFewSamplesError(n_segments, len(mixture.weights))
    step(ASSIGNED)
    of_components = mixture.posteriors(training.standardized)
    posteriors = of_components @ np.eye(kinds.count)[kind]
    overlaps = posteriors.T @ (posteriors * training.shares[:, None])
    kinds = _with_vanished_first(kinds, found, after)
    areas = training.shares @ of_components
    tree = MergeTree.of(mixture.means @ axes, mixture.weights, areas, kind, kinds, overlaps)
    return PartMixture(mixture, tree, not alone)


def principal_axes(training: TrainingSamples) -> FloatArray:
    """(d, AXES) principal axes of the standardized signatures, divided by a power of their variance."""
    samples = training.standardized
    variances, axes = np.linalg.eigh((samples * training.shares[:, None]).T @ samples)
    chosen = slice(None, -AXES - 1, -1)
    return np.asarray(axes[:, chosen] / (np.maximum(variances[chosen], 0) + LEAST_VARIANCE) ** WHITENING)


def kinds_of(
    meshes: Sequence[Sequence[Workpiece]],
    training: TrainingSamples,
    axes: FloatArray,
    n_segments: int,
    rest: TriangleMesh | None,
    cache: Cache | None,
    progress: Progress,
) -> tuple[Kinds, bool]:
    """Kinds of parts of the meshes, each in some poses, and whether they were in the cache."""
    key = ""
    if cache is not None:
        n_kinds = n_kinds_of_bodies(n_segments) if len(meshes) > 1 else None
        settings = training.standardizer.scaling, n_regions_of_mesh(n_segments), n_kinds
        description = ("kinds", KINDS_VERSION, [len(of_mesh) for of_mesh in meshes], settings, rest is None)
        at_rest = {} if rest is None else rest.arrays()
        key = content_key(description, at_rest, *(pose.pose.arrays() for of_mesh in meshes for pose in of_mesh))
        known = Kinds.of_arrays(cache.arrays(key) or {})
        if known is not None:
            return known, True
    evidence, projected = [], []
    for i, (of_mesh, step) in enumerate(progress.part(0.0, 0.5).each(meshes)):
        evidence.append(Evidence.of(of_mesh, rest if i == 0 else None, step, cache))
        in_poses = [
            pose.surface.to_faces(training.standardizer.transform(pose.signature, np.float64) @ axes)
            for pose in of_mesh
        ]
        projected.append(np.mean(in_poses, axis=0))
    agree = partial(_agreed, meshes=meshes, training=training, axes=axes, least=least_kinds_of_bodies(n_segments))
    kinds = find_kinds(evidence, projected, n_segments, progress.part(0.5, GROWN), agree)
    if cache is not None:
        try:
            cache.keep(key, kinds.arrays())
        except OSError as error:
            warnings.warn(
                Message("parts were not kept for the next time: {reason}", reason=message_of(error)), stacklevel=3
            )
    return kinds, False


def _agreed(
    graphs: Sequence[PartGraph],
    kinds: Sequence[IntArray],
    meshes: Sequence[Sequence[Workpiece]],
    training: TrainingSamples,
    axes: FloatArray,
    least: int,
) -> list[IntArray]:
    """See `AgreeFunction`."""
    of_faces = [np.searchsorted(graph.regions, graph.region_of_faces()) for graph in graphs]
    region = _kinds_of_samples(of_faces, meshes, training, max(len(graph.regions) for graph in graphs))
    of_meshes = [region[training.pose == i] for i in range(len(graphs))]
    return agreed_kinds(kinds, [graph.ties() for graph in graphs], of_meshes, training, axes, least)


def _kinds_of_samples(
    of_faces: Sequence[IntArray], meshes: Sequence[Sequence[Workpiece]], training: TrainingSamples, n_kinds: int
) -> IntArray:
    """(n,) kind of each training sample: the one with most area around its vertex."""
    of_poses = [
        shares_at_vertices(pose.surface, kind, n_kinds).argmax(axis=1)
        for of_mesh, kind in zip(meshes, of_faces, strict=True)
        for pose in of_mesh
    ]
    kind_of_samples = np.empty(len(training.pose), dtype=np.int64)
    for i, of_pose in enumerate(of_poses):
        here = training.pose == i
        kind_of_samples[here] = of_pose[training.vertex[here]]
    return kind_of_samples


def _mean_posteriors(
    poses: Sequence[Workpiece], standardizer: Standardizer, mixture: GaussianMixture, kind: IntArray, n_kinds: int
) -> FloatArray:
    """(m, k) smoothed posteriors of the kinds on the faces of a mesh, mean over its poses."""

    def posteriors(pose: Workpiece) -> FloatArray:
        return mixture.group_posteriors(standardizer.transform(pose.signature), kind, n_kinds)

    smooth = smooth_means(poses, posteriors, SMOOTHING_LENGTH)
    return np.mean([pose.surface.to_faces(smooth(pose)) for pose in poses], axis=0)


def _with_vanished_first(kinds: Kinds, found: FloatArray, left: FloatArray) -> Kinds:
    """The kinds with those merged first that have lost most of their area.

    Given the (k,) shares of the area that the kinds had when they were found, and have now.
    """
    vanished = np.flatnonzero(left < VANISHED * found)
    merges, likeness = kinds.merges.tolist(), kinds.likeness.tolist()
    done = 0
    for lost in vanished.tolist():
        at = next((i for i in range(done, len(merges)) if lost in merges[i]), None)
        if at is None:  # another kind that vanished has taken it
            continue
        kept, gone = merges.pop(at)
        other = kept if lost == gone else gone
        if lost == kept:
            merges = [[other if one == lost else one for one in pair] for pair in merges]
        merges.insert(done, [other, lost])
        likeness.insert(done, likeness.pop(at))
        done += 1
    return replace(kinds, merges=np.array(merges, dtype=np.int64).reshape(-1, 2), likeness=np.array(likeness))
