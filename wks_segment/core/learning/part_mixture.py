"""A mixture of the signatures inside each kind of part.

Signatures alone make bands of equal thickness, never a head or a finger. So the learned meshes are cut into parts
first, by everything that is known of them (`core/parts`), and the mixture only has to recognize these: several
components describe the signatures inside each kind of part.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..mesh.surface import shares_at_vertices
from ..mesh.triangle_mesh import BoolArray, FloatArray, IntArray, TriangleMesh
from ..message import Message, message_of
from ..parts.evidence import Evidence
from ..parts.kind_traits import KindTraits
from ..parts.kinds import Kinds, find_kinds, n_kinds_of_bodies, n_regions_of_mesh
from ..poses.pose_cache import Workpiece, smooth_means
from ..poses.pose_signature import of_one_mesh
from ..poses.signature_cache import Cache, content_key
from ..progress import Progress
from .body_plan import BodyPlan
from .gaussian_mixture import (
    CovarianceType,
    GaussianMixture,
    TooFewSamplesError,
    fit_mixture,
    maximize,
    squares_of,
    variance_floor,
)
from .k_means import k_means
from .merge_tree import MergeTree
from .parameters import effective, least_segments
from .standardizer import Standardizer
from .taught_parts import TaughtParts
from .training_samples import TrainingSamples

KINDS_VERSION = 6
"""To be raised whenever the same poses and settings give other kinds than before."""
AXES, WHITENING, LEAST_VARIANCE = 20, 0.25, 1e-2
"""Number of principal axes of the signatures along which parts are compared, and the power of their variance, with a
little added, that they are divided by: later axes, which tell small parts apart, then count more, but less than the
first ones."""
COMPONENTS_OF_MESH, COMPONENTS_OF_POSE, COMPONENTS_OF_BODIES, PER_SEGMENT = 100, 40, 60, 2
"""Number of components of the mixture of one mesh, but at most so many for each of its poses; of the mixture of several
meshes; and the least number for each segment. With
more, poses and bodies that were not learned are recognized worse, with fewer, parts are not kept
(docs/dev/experiments.md)."""
SMOOTHING_LENGTH = 0.03
"""Width of the smoothing along borders at smoothness 1, in units of the square root of the area."""
VANISHED = 0.5
"""A kind that keeps less than this share of its area when borders move is merged before all others."""
K_MEANS_ROUNDS = 10
"""Most rounds of k-means: later ones move places between clusters of one kind, and carry noise on."""
FOUND = 0.63
"""Share of the time of finding parts and fitting the mixture after which the kinds are found."""


@dataclass(frozen=True)
class PartMixture:
    """What is learned of the parts of some poses.

    Attributes
    ----------
    mixture : GaussianMixture
    grouping : MergeTree or None
        Order in which its components are merged into kinds of parts, and these into segments; None with the paper's
        setting.
    traits : KindTraits or None
        Of the kinds, in the order of the groups that these are, if several meshes were learned.
    taught : TaughtParts or None
        The first groups as parts that a user taught, if any.
    plan : BodyPlan or None
        Where these lie in the plan of a body, if at least three symmetric bodies were taught, and nothing else
        was learned.
    """

    mixture: GaussianMixture
    grouping: MergeTree | None
    traits: KindTraits | None
    taught: TaughtParts | None = None
    plan: BodyPlan | None = None

    def for_ranking(self, mixture: GaussianMixture) -> GaussianMixture:
        """A mixture of these parts as its densities tell which model fits a shape.

        A full covariance tells parts of one mesh apart, but between meshes its small eigenvalues, which are noise of
        the learned poses, outweigh everything else: variances alone count. The paper's setting is kept, and models of
        0.1.0, whose usual scores were computed with the covariance that they have.
        """
        if self.grouping is None or self.grouping.areas is None:
            return mixture
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
        return PartMixture(fit_mixture(samples, shares, n_segments, covariance_type, seed, step), None, None)
    alone = len(poses) == 1 or of_one_mesh([pose.pose for pose in poses])
    meshes = [poses] if alone else [[pose] for pose in poses]
    axes = principal_axes(training)
    step = progress.part(0.0, FOUND, "parts")
    kinds, were_known = kinds_of(meshes, training.standardizer, axes, n_segments, rest, cache, step)
    if covariance_type == "auto":
        covariance_type = "tied" if alone else "shared"
    usual = min(COMPONENTS_OF_MESH, COMPONENTS_OF_POSE * len(poses)) if alone else COMPONENTS_OF_BODIES
    count = max(usual, PER_SEGMENT * n_segments)
    step = progress.part(0.0 if were_known else FOUND, 1.0, "mixture")
    kind_of_samples = _kinds_of_samples(kinds.of_faces, meshes, training, kinds.count)
    found = after = np.bincount(kind_of_samples, training.shares, kinds.count).astype(np.float64)
    mixture, kind = fitted_inside(training, kind_of_samples, axes, count, covariance_type)
    if alone:
        step(0.2)
        moved = _mean_posteriors(poses, training.standardizer, mixture, kind, kinds.count).argmax(axis=1)
        kind_of_samples = _kinds_of_samples([moved], meshes, training, kinds.count)
        after = np.bincount(kind_of_samples, training.shares, kinds.count).astype(np.float64)
        mixture, kind = fitted_inside(training, kind_of_samples, axes, count, covariance_type)
    if len(mixture.weights) < n_segments:
        raise TooFewSamplesError(n_segments, len(mixture.weights))
    step(0.8)
    of_components = mixture.posteriors(training.standardized)
    posteriors = of_components @ np.eye(kinds.count)[kind]
    overlaps = posteriors.T @ (posteriors * training.shares[:, None])
    kinds = _with_vanished_first(kinds, found, after)
    areas = training.shares @ of_components
    tree = MergeTree.of(mixture.means @ axes, mixture.weights, areas, kind, kinds, overlaps)
    kind_of_groups = np.zeros(tree.n_kinds, dtype=np.int64)
    kind_of_groups[tree.groups(tree.n_kinds)] = kind
    return PartMixture(mixture, tree, None if kinds.traits is None else kinds.traits.of_kinds(kind_of_groups))


def principal_axes(training: TrainingSamples) -> FloatArray:
    """(d, AXES) principal axes of the standardized signatures, divided by a power of their variance."""
    samples = training.standardized
    variances, axes = np.linalg.eigh((samples * training.shares[:, None]).T @ samples)
    chosen = slice(None, -AXES - 1, -1)
    return np.asarray(axes[:, chosen] / (np.maximum(variances[chosen], 0) + LEAST_VARIANCE) ** WHITENING)


def kinds_of(
    meshes: Sequence[Sequence[Workpiece]],
    standardizer: Standardizer,
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
        settings = standardizer.scaling, n_regions_of_mesh(n_segments), n_kinds
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
            pose.surface.to_faces(standardizer.transform(pose.signature, np.float64) @ axes) for pose in of_mesh
        ]
        projected.append(np.mean(in_poses, axis=0))
    kinds = find_kinds(evidence, projected, n_segments, progress.part(0.5, 1.0))
    if cache is not None:
        try:
            cache.keep(key, kinds.arrays())
        except OSError as error:
            warnings.warn(
                Message("parts were not kept for the next time: {reason}", reason=message_of(error)), stacklevel=3
            )
    return kinds, False


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


def fitted_inside(
    training: TrainingSamples, kind_of_samples: IntArray, axes: FloatArray, count: int, covariance_type: CovarianceType
) -> tuple[GaussianMixture, IntArray]:
    """Mixture of about `count` components, each the samples of a cluster inside one kind; and (K,) their kinds.

    Larger kinds have more clusters, by the square root of their area. With full matrices each kind has one.
    """
    places, shares = training.standardized @ axes, training.shares
    present = np.unique(kind_of_samples)
    sizes = np.sqrt([shares[kind_of_samples == k].sum() for k in present])
    cluster = np.empty(len(places), dtype=np.int64)
    kinds: list[int] = []
    for k, size in zip(present, sizes, strict=True):
        members = np.flatnonzero(kind_of_samples == k)
        wanted = 1 if covariance_type == "full" else max(1, round(count * size / sizes.sum()))
        inside = _clusters(places[members], shares[members], wanted)
        cluster[members] = len(kinds) + inside
        kinds += [int(k)] * (int(inside.max()) + 1)
    masses = np.zeros((len(places), len(kinds)))
    masses[np.arange(len(places)), cluster] = shares
    samples = training.standardized
    floor = variance_floor(samples, shares)
    return maximize(samples, squares_of(samples, covariance_type), masses, covariance_type, floor), np.array(kinds)


def _clusters(places: FloatArray, shares: FloatArray, count: int) -> IntArray:
    """(n,) cluster of each place by k-means: 0, 1, …; fewer than `count` if there are fewer distinct places."""
    if count == 1 or len(places) <= 1:
        return np.zeros(len(places), dtype=np.int64)
    halves = _halves(places, shares, count)
    starts = np.array(
        [np.average(places[halves == i], axis=0, weights=shares[halves == i]) for i in range(halves.max() + 1)]
    )
    found = k_means(places, shares, starts, K_MEANS_ROUNDS)
    return np.unique(found, return_inverse=True)[1].ravel()


def _halves(places: FloatArray, shares: FloatArray, count: int) -> IntArray:
    """(n,) cluster of each place: the widest one is halved, across its longest axis, until there are `count`.

    From these k-means ends alike after a little noise, which it does not from random places.
    """
    cluster = np.zeros(len(places), dtype=np.int64)
    width, far = _across_longest_axis(places, shares)
    widths, halves = [width], [far]
    while len(widths) < count:
        widest = int(np.argmax(widths))
        far = halves[widest]
        if not far.any():
            break
        members = np.flatnonzero(cluster == widest)
        cluster[members[far]] = len(widths)
        widths[widest], halves[widest] = _across_longest_axis(places[members[~far]], shares[members[~far]])
        width, far = _across_longest_axis(places[members[far]], shares[members[far]])
        widths.append(width)
        halves.append(far)
    return cluster


def _across_longest_axis(places: FloatArray, shares: FloatArray) -> tuple[float, BoolArray]:
    """Sum of squares of places along their longest axis, and (n,) which lie in its far half; none if all are equal."""
    offset = places - np.average(places, axis=0, weights=shares)
    squares, axes = np.linalg.eigh((offset * shares[:, None]).T @ offset)
    along = offset @ axes[:, -1]
    # A direction that does not depend on the library's choice of sign.
    far = along * (-1 if shares @ along**3 < 0 else 1) > 0
    return float(squares[-1]), far & bool(squares[-1] > 0 and not far.all())


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
