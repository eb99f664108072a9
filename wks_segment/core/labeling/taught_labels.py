"""What a model of taught parts knows of their regions: which are left and right, and whether it finds them again."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import get_args

import numpy as np

from ..learning.parameters import Preset
from ..learning.part_mixture import PartMixture
from ..learning.taught_mixture import touching_parts
from ..learning.taught_parts import TaughtLabels, TaughtParts, Unlabeled, UnlikePartsError, checked_labels
from ..mesh.triangle_mesh import IntArray, TriangleMesh
from ..message import Message
from ..poses.arguments import as_list
from ..poses.pose_cache import AnyPose, Workpiece
from ..progress import Progress
from .labeler import Labeler
from .region_atlas import RegionAtlas
from .taught_sides import UNKNOWN_SIDE, oriented, sides_by_labels
from .traits import Traits

LEAST_ON_SIDE, LEAST_APART = 0.75, 0.65
"""Least share of the area of two alike parts that has its own label, not that of the other part, on the mesh that they
were taught on: of left and right parts, and of parts that are learned apart. Chance finds a half."""
GROUPED_SHARE = 0.7
"""Share of the time of learning taught parts after which their mixture is known."""


def lesson_of(
    labels: Sequence[IntArray | None], meshes: Sequence[AnyPose], unlabeled: Unlabeled, preset: Preset
) -> TaughtLabels:
    """What `fit` is taught by its arguments; ValueError if labels do not fit, or cannot be learned."""
    if preset == "paper":
        raise ValueError('parts are taught with preset="default": with the paper\'s setting each component is a part')
    if unlabeled not in get_args(Unlabeled):
        raise ValueError(Message('unlabeled must be "learn" or "ignore", not {value!r}', value=unlabeled))
    originals = [mesh if isinstance(mesh, TriangleMesh) else mesh.surface.original for mesh in meshes]
    of_faces = checked_labels(as_list(labels, "labels"), [mesh.n_faces for mesh in originals])
    return TaughtLabels(of_faces, unlabeled)


def learned_lesson(
    lesson: TaughtLabels,
    learn: Callable[[TaughtLabels, Progress], PartMixture],
    labeler_of: Callable[[PartMixture], Labeler],
    poses: Sequence[Workpiece],
    rest: TriangleMesh | None,
    progress: Progress,
) -> tuple[PartMixture, tuple[RegionAtlas, RegionAtlas]]:
    """Parts that were taught, and their regions; two alike ones that are no left and right are learned apart.

    Parameters
    ----------
    lesson : TaughtLabels
    learn, labeler_of
        Fit a mixture to a lesson, and make the labeler of a mixture, without an atlas.
    poses, rest, progress
        As for `recognized_taught_parts`.

    Raises
    ------
    UnlikePartsError
        If a part is not found again all the same.
    """
    while True:
        learned = learn(lesson, progress.part(0.0, GROUPED_SHARE))
        step = progress.part(GROUPED_SHARE, 1.0)
        try:
            return recognized_taught_parts(labeler_of(learned), learned, poses, lesson, rest, step)
        except UnlikePartsError as error:
            if learned.taught is None or not learned.taught.has_pair(*error.parts):
                raise
            lesson = replace(lesson, apart=lesson.apart | {error.parts})


def recognized_taught_parts(
    labeler: Labeler,
    learned: PartMixture,
    poses: Sequence[Workpiece],
    lesson: TaughtLabels,
    rest: TriangleMesh | None,
    progress: Progress,
) -> tuple[PartMixture, tuple[RegionAtlas, RegionAtlas]]:
    """Atlases of the regions of taught parts, and the parts with left and right in their places.

    Parameters
    ----------
    labeler : Labeler
        Of the model, without an atlas.
    learned : PartMixture
    poses
        The learned poses.
    lesson : TaughtLabels
    rest : TriangleMesh or None
        The mesh of the first pose at rest.
    progress : Progress

    Raises
    ------
    UnlikePartsError
        If two taught parts are alike, and not left and right of each other.
    """
    assert learned.taught is not None
    labels = lesson.of_faces
    # The first pose tells left from right: the one that shows the most parts.
    first = int(np.argmax([len(np.unique(of_mesh)) for of_mesh in labels]))
    same_mesh = np.array_equal(poses[first].surface.original.faces, poses[0].surface.original.faces)
    at_rest = rest if rest is not None and same_mesh else None
    in_order, labels_in_order = (
        [of_poses[first], *of_poses[:first], *of_poses[first + 1 :]] for of_poses in (poses, labels)
    )
    mesh = in_order[0].surface.original
    touching = touching_parts([poses[first]], [labels[first]], learned.taught.n_parts)
    taught = oriented(learned.taught, labels[first], mesh if at_rest is None else at_rest, touching)
    labeler = replace(labeler, taught=taught)
    atlas = _atlas(labeler, in_order, labels_in_order, at_rest, taught, progress.part(0.0, 0.7))
    labeler = replace(labeler, sides_atlas=atlas)
    _check_found(labeler, in_order[0], lesson, labels[first], taught, progress.part(0.7, 1.0))
    return replace(learned, taught=taught), (atlas, atlas)


def _atlas(
    labeler: Labeler,
    poses: Sequence[Workpiece],
    labels: Sequence[IntArray],
    rest: TriangleMesh | None,
    taught: TaughtParts,
    progress: Progress,
) -> RegionAtlas:
    """Atlas of the regions of taught parts: where labels say left and right, regions need not be matched."""
    first = poses[0].surface.original
    regions, traits = labeler.regions_of(labeler.n_segments, poses, progress)
    centers = regions[0].centers(first if rest is None else rest)
    sides = [
        sides_by_labels(one.region, len(one.segment), taught, of_mesh, pose.surface.original.face_areas)
        for one, of_mesh, pose in zip(regions, labels, poses, strict=True)
    ]
    alike = all(one is regions[0] for one in regions)
    numbers = [_numbers(traits[0], sides[0], *one) for one in zip(traits, sides, strict=True)]
    atlas = RegionAtlas.learned(labeler.n_segments, traits, centers, alike, [] if alike else numbers)
    return replace(atlas, side=np.where(sides[0] == UNKNOWN_SIDE, atlas.side, sides[0]))


def _numbers(known: Traits, known_side: IntArray, found: Traits, side: IntArray) -> IntArray | None:
    """(r,) number of each found region: of the known one with its segment and side; None if sides are not known.

    Of several regions with one segment and side the largest ones are the same.
    """
    sided = np.isin(found.segment, known.segment[known_side != UNKNOWN_SIDE])
    if (sided & (side == UNKNOWN_SIDE)).any() or not sided.any():
        return None
    places: dict[tuple[int, int], list[int]] = {}
    for i in np.argsort(-known.area, kind="stable").tolist():
        places.setdefault((int(known.segment[i]), int(known_side[i])), []).append(i)
    numbers, new = np.empty(len(side), dtype=np.int64), len(known.segment)
    for i in np.argsort(-found.area, kind="stable").tolist():
        same = places.get((int(found.segment[i]), int(side[i])), [])
        numbers[i] = same.pop(0) if same else new
        new += int(numbers[i] == new)
    return numbers


def _check_found(
    labeler: Labeler,
    pose: Workpiece,
    lesson: TaughtLabels,
    labels: IntArray,
    taught: TaughtParts,
    progress: Progress,
) -> None:
    """UnlikePartsError if one of two alike parts has the label of the other where it was taught."""
    if not len(taught.sided) and not lesson.apart:
        return
    found = labeler.segments([pose], None, labeler.min_share, progress)[0]
    areas = pose.surface.original.face_areas
    pairs = zip(taught.left[taught.sided].tolist(), taught.right[taught.sided].tolist(), strict=True)
    least_of_pairs = dict.fromkeys(pairs, LEAST_ON_SIDE) | dict.fromkeys(lesson.apart, LEAST_APART)
    for pair, least in least_of_pairs.items():
        shares = []
        for part, other in (pair, pair[::-1]):
            right, wrong = (float(areas[(labels == part) & (found == one)].sum()) for one in (part, other))
            shares.append(right / (right + wrong) if right + wrong > 0 else 1.0)
        if np.mean(shares) < least:
            raise UnlikePartsError(*sorted(pair))
