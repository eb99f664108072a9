"""Measures of agreement of labels: with the learned poses, with segmentations by people, and with each other."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
from scipy.sparse import coo_matrix
from sklearn.metrics import adjusted_rand_score

from wks_segment.core import PoseSegmentation, PoseSignature
from wks_segment.core.mesh.triangle_mesh import IntArray


@dataclass(frozen=True)
class AgreementWithLearned:
    """Agreement of labels in unseen poses with those in the learned poses of the same mesh.

    Attributes
    ----------
    known : (m,) int array
        Label of each face by all learned poses together.
    labels : dict
        Name of each unseen pose to the labels of its faces.
    shares : list of float
        For each unseen pose the share of its area with the known label.
    """

    known: IntArray
    labels: dict[str, IntArray]
    shares: list[float]


@dataclass(frozen=True)
class AgreementWithPeople:
    """Agreement of labels of unseen shapes of a class with segmentations and part names by people.

    Attributes
    ----------
    regions : dict
        Name of each shape to the region of each of its faces.
    errors : list of float
        Rand-index error of the regions of each shape, averaged over the segmentations by people.
    named : list of float
        Adjusted Rand index between segments and part names, for each shape that has part names.
    """

    regions: dict[str, IntArray]
    errors: list[float]
    named: list[float]


def with_learned(
    model: PoseSegmentation, poses: Mapping[str, PoseSignature], learned: Sequence[str]
) -> AgreementWithLearned:
    """Fit a model to some poses of a mesh and label the others."""
    chosen = [poses[name] for name in learned]
    faces = np.arange(chosen[0].surface.original.n_faces)
    known = model.fit(chosen).segment_polygons(chosen, [faces] * len(chosen))
    labels = {name: model.segment_faces(pose) for name, pose in poses.items() if name not in learned}
    shares = [
        float(np.average(of_pose == known, weights=poses[name].surface.original.face_areas))
        for name, of_pose in labels.items()
    ]
    return AgreementWithLearned(known, labels, shares)


def with_people(
    model: PoseSegmentation, shapes: Mapping[str, PoseSignature], learned: Sequence[str], truth: Mapping[str, Any]
) -> AgreementWithPeople:
    """Fit a model to some shapes and compare the others with their "human_segmentations" and "part_names"."""
    model.fit([shapes[name] for name in learned])
    others = {name: shape for name, shape in shapes.items() if name not in learned}
    regions = {name: model.segment_regions(shape) for name, shape in others.items()}
    errors = [
        float(np.mean([rand_index_error(labels, person) for person in truth[name]["human_segmentations"]]))
        for name, labels in regions.items()
    ]
    named = [
        float(adjusted_rand_score(truth[name]["part_names"], model.segment_faces(shape)))
        for name, shape in others.items()
        if "part_names" in truth[name]
    ]
    return AgreementWithPeople(regions, errors, named)


def of_pairs(labels: Sequence[IntArray]) -> list[float]:
    """Adjusted Rand index of each pair of labelings."""
    return [float(adjusted_rand_score(a, b)) for a, b in combinations(labels, 2)]


def of_people(segmentations: Sequence[Any]) -> float:
    """Rand-index error between segmentations by different people, averaged over all pairs; 0 if there is only one."""
    labelings = [np.unique(segmentation, return_inverse=True)[1].ravel() for segmentation in segmentations]
    return float(np.mean([rand_index_error(a, b) for a, b in combinations(labelings, 2)] or [0.0]))


def rand_index_error(labels: IntArray, others: Any) -> float:
    """Share of pairs of faces that are in one segment in one of the segmentations and in two in the other."""
    n = len(labels)
    table = coo_matrix((np.ones(n), (labels, np.unique(others, return_inverse=True)[1].ravel()))).toarray()
    together = (table.sum(axis=1) ** 2).sum() + (table.sum(axis=0) ** 2).sum()
    return float((together / 2 - (table**2).sum()) / (n * (n - 1) / 2))
