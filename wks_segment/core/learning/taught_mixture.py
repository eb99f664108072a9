"""A mixture of the signatures inside each taught part, and what was not said cut into kinds of parts as usual."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..geometry.heat_flow import Flows
from ..mesh.surface import Surface, shares_at_vertices
from ..mesh.triangle_mesh import FloatArray, IntArray, TriangleMesh
from ..message import Message
from ..parts.body_places import BodyPlaces
from ..parts.kinds import Kinds
from ..poses.pose_cache import Workpiece
from ..poses.pose_signature import of_one_mesh
from ..poses.signature_cache import Cache
from ..progress import Progress
from ..user_labels import NOT_SAID
from .body_plan import BodyPlan
from .gaussian_mixture import CovarianceType, GaussianMixture
from .inside_parts import fitted_inside
from .merge_tree import MOST_LIKENESS, MergeTree
from .parameters import effective, least_segments
from .part_mixture import PartMixture, kinds_of, principal_axes
from .taught_parts import TaughtLabels, TaughtParts, alike_parts, with_like_neighbors
from .training_samples import TrainingSamples

TAUGHT_OF_MESH, TAUGHT_OF_BODIES = 40, 6
"""Number of components for each taught part, from poses of one mesh and from several meshes: with more, other bodies
are recognized worse (docs/dev/experiments.md)."""
STRETCH = 0.025
"""Standard deviation of the logarithm of an edge's length (median over edges) from which meshes with the same faces are
several bodies: poses of MakeHuman have 0.009, bodies made from it 0.040 and more."""
LEAST_LEFT = 0.01
"""Share of the area that is not said from which it is cut into parts of its own: less is what was forgotten."""


def learn_taught_parts(
    parameters: Mapping[str, Any],
    poses: Sequence[Workpiece],
    lesson: TaughtLabels,
    progress: Progress,
    training: TrainingSamples,
    rest: TriangleMesh | None,
    cache: Cache | None,
) -> PartMixture:
    """Fit a mixture to the parts that labels say; with "learn", to parts of what is not said as well.

    Parameters
    ----------
    parameters
        Of the model.
    poses
        Of one mesh, with the same faces; otherwise each is another mesh.
    lesson : TaughtLabels
    training : TrainingSamples
        Of the poses.
    rest, cache, progress
        As for `learn_parts`.

    Raises
    ------
    ValueError
        If a part is too small to have a sample, or `rest` has other faces than the first pose.
    """
    alone = of_one_body(poses)
    meshes = [poses] if alone else [[pose] for pose in poses]
    axes = principal_axes(training)
    n_parts = 1 + max(int(of_pose.max()) for of_pose in lesson.of_faces)
    part_of_samples = _of_samples(poses, lesson.of_faces, n_parts, training)
    counts = np.bincount(part_of_samples[part_of_samples >= 0], minlength=n_parts)
    if not counts.all():
        raise ValueError(Message("part {part} is too small to be learned: mark more of it", part=int(counts.argmin())))
    pairs = alike_parts(training.standardized @ axes, part_of_samples, n_parts, lesson.apart)
    pairs = with_like_neighbors(pairs, touching_parts(poses, lesson.of_faces, n_parts))
    taught = TaughtParts.of(n_parts, pairs, not alone)
    said = part_of_samples >= 0
    group = np.where(said, taught.group_of_part[part_of_samples], NOT_SAID)
    kinds, n_groups = None, taught.n_groups
    if lesson.unlabeled == "learn" and training.shares[~said].sum() > LEAST_LEFT:
        n_segments = least_segments(parameters["n_segments"])
        step = progress.part(0.0, 0.5, "parts")
        kinds = kinds_of(meshes, training, axes, n_segments, rest, cache, step)[0]
        of_faces = kinds.of_faces if not alone else [kinds.of_faces[0]] * len(poses)
        group[~said] = n_groups + _of_samples(poses, of_faces, kinds.count, training)[~said]
        n_groups += kinds.count
    progress.part(0.5, 1.0, "mixture")(0.0)
    asked = effective(parameters, "covariance_type")
    covariance_type: CovarianceType = ("tied" if alone else "diag") if asked == "auto" else asked
    per_part = TAUGHT_OF_MESH if alone else TAUGHT_OF_BODIES
    chosen = training.only(group >= 0)
    mixture, group_of = fitted_inside(
        chosen, group[group >= 0], axes, per_part * len(np.unique(group[group >= 0])), covariance_type
    )
    plan = None
    if not alone and n_groups == taught.n_groups:
        plan = plan_of([pose.surface for pose in poses], lesson.of_faces, taught)
    tree = _tree(mixture, group_of, axes, training, n_groups, taught, kinds)
    return PartMixture(mixture, tree, False, taught, plan)


def plan_of(surfaces: Sequence[Surface], labels: Sequence[IntArray], taught: TaughtParts) -> BodyPlan | None:
    """Where taught parts lie in the plan of a body; None if no symmetric surface shows each of them.

    Given (m,) taught part of each face of the original of each surface, −1 for none.
    """
    bodies = []
    for surface, of_faces in zip(surfaces, labels, strict=True):
        places = BodyPlaces.of(surface, Flows(surface.mesh))
        if places is not None:
            group = np.where(of_faces >= 0, taught.group_of_part[of_faces], NOT_SAID)
            bodies.append((places, places.areas_of(group, surface.original.face_areas, taught.n_groups)))
    return BodyPlan.learned(bodies)


def of_one_body(poses: Sequence[Workpiece]) -> bool:
    """Whether the poses are of one mesh that bends, and not of several bodies, which may have the same faces."""
    meshes = [pose.surface.original for pose in poses]
    if len(meshes) == 1 or not of_one_mesh([pose.pose for pose in poses]):
        return len(meshes) == 1
    faces = meshes[0].faces
    logs = []
    for mesh in meshes:
        corners = mesh.vertices[faces] / np.sqrt(mesh.area)
        lengths = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
        logs.append(np.log(np.maximum(lengths.ravel(), np.finfo(float).tiny)))
    return bool(np.median(np.std(logs, axis=0)) < STRETCH)


def touching_parts(poses: Sequence[Workpiece], labels: Sequence[IntArray], n_parts: int) -> FloatArray:
    """(parts, parts) length of the borders between taught parts on all poses."""
    table = np.zeros((n_parts, n_parts))
    for pose, part in zip(poses, labels, strict=True):
        first, second = part[pose.neighbors.pairs].T
        border = (first >= 0) & (second >= 0) & (first != second)
        np.add.at(table, (first[border], second[border]), pose.neighbors.lengths[border])
    return table + table.T


def _of_samples(
    poses: Sequence[Workpiece], labels: Sequence[IntArray], count: int, training: TrainingSamples
) -> IntArray:
    """(n,) label of each training sample: the one with most area around its vertex, −1 if there is none."""
    of_samples = np.empty(len(training.pose), dtype=np.int64)
    for i, (pose, of_faces) in enumerate(zip(poses, labels, strict=True)):
        shares = shares_at_vertices(pose.surface, of_faces, count)
        of_vertices = np.where(shares.any(axis=1), shares.argmax(axis=1), NOT_SAID)
        here = training.pose == i
        of_samples[here] = of_vertices[training.vertex[here]]
    return of_samples


def _tree(
    mixture: GaussianMixture,
    group_of: IntArray,
    axes: FloatArray,
    training: TrainingSamples,
    n_groups: int,
    taught: TaughtParts,
    kinds: Kinds | None,
) -> MergeTree:
    """Tree whose first groups are the taught ones, in their order, whatever the number of groups.

    Groups are numbered in the reverse order of the merges: kinds that were not taught are merged first, what is left of
    them goes to the first taught group, and then all taught groups, the last one first.
    """
    merges: list[tuple[int, int]] = []
    likeness: list[float] = []
    if kinds is not None:
        present = {int(one) for one in group_of if one >= taught.n_groups}
        root = {k: k + taught.n_groups for k in range(kinds.count)}
        for (kept, gone), odds in zip(kinds.merges.tolist(), kinds.likeness.tolist(), strict=True):
            first, second = root[kept], root[gone]
            if first in present and second in present:
                merges.append((first, second))
                likeness.append(odds)
            root[kept] = first if first in present else second
        left = root[int(kinds.merges[-1][0])] if len(kinds.merges) else root[0]
        merges.append((0, left))
        likeness.append(-MOST_LIKENESS)
    for last in range(taught.n_groups - 1, 0, -1):
        merges.append((0, last))
        likeness.append(-MOST_LIKENESS)
    of_components = mixture.posteriors(training.standardized)
    of_groups = of_components @ np.eye(n_groups)[group_of]
    order = Kinds([], np.array(merges, dtype=np.int64).reshape(-1, 2), np.array(likeness))
    # The measures of the tree are of all groups that occur: a kind without a component is merged with the others.
    overlaps = of_groups.T @ (of_groups * training.shares[:, None])
    areas = training.shares @ of_components
    return MergeTree.of(mixture.means @ axes, mixture.weights, areas, group_of, order, overlaps, n_groups)
