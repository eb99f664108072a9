"""How far labels agree: with those of the poses that were learned, with people's, with each other."""

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
class WithLearned:
    """Labels of poses with the same faces, some of them learned.

    Attributes
    ----------
    known : (m,) int array
        The label that the learned poses give each face.
    labels : dict
        Name of each other pose to the labels of its faces.
    shares : list of float
        The share of each other pose's area that has the known label.
    """

    known: IntArray
    labels: dict[str, IntArray]
    shares: list[float]


@dataclass(frozen=True)
class WithPeople:
    """Shapes of a class that were not learned.

    Attributes
    ----------
    regions : dict
        Name of each shape to its connected parts.
    errors : list of float
        The Rand-index error of these against people's: of each shape the mean over people.
    named : list of float
        The adjusted Rand index between components and part names, of each shape whose parts have names.
    """

    regions: dict[str, IntArray]
    errors: list[float]
    named: list[float]


def with_learned(model: PoseSegmentation, poses: Mapping[str, PoseSignature], learned: Sequence[str]) -> WithLearned:
    """Learn some of the poses, which all have the same faces, and find their labels in the others."""
    chosen = [poses[name] for name in learned]
    faces = np.arange(chosen[0].surface.original.n_faces)
    known = model.fit(chosen).segment_polygons(chosen, [faces] * len(chosen))
    labels = {name: model.segment_faces(pose) for name, pose in poses.items() if name not in learned}
    shares = [
        float(np.average(of_pose == known, weights=poses[name].surface.original.face_areas))
        for name, of_pose in labels.items()
    ]
    return WithLearned(known, labels, shares)


def with_people(
    model: PoseSegmentation, shapes: Mapping[str, PoseSignature], learned: Sequence[str], truth: Mapping[str, Any]
) -> WithPeople:
    """Learn some of the shapes and compare the others with "human_segmentations" and "part_names" of each."""
    model.fit([shapes[name] for name in learned])
    others = {name: shape for name, shape in shapes.items() if name not in learned}
    regions = {name: model.segment_regions(shape) for name, shape in others.items()}
    errors = [
        float(np.mean([rand_index_error(of_shape, one) for one in truth[name]["human_segmentations"]]))
        for name, of_shape in regions.items()
    ]
    named = [
        float(adjusted_rand_score(truth[name]["part_names"], model.segment_faces(shape)))
        for name, shape in others.items()
        if "part_names" in truth[name]
    ]
    return WithPeople(regions, errors, named)


def of_pairs(labels: Sequence[IntArray]) -> list[float]:
    """Adjusted Rand index of each two of some labelings."""
    return [float(adjusted_rand_score(a, b)) for a, b in combinations(labels, 2)]


def of_people(segmentations: Sequence[Any]) -> float:
    """Rand-index error of people against each other, the mean of all pairs; 0 for one."""
    each = [np.unique(one, return_inverse=True)[1].ravel() for one in segmentations]
    return float(np.mean([rand_index_error(a, b) for a, b in combinations(each, 2)] or [0.0]))


def rand_index_error(labels: IntArray, others: Any) -> float:
    """Share of the pairs of faces that one segmentation puts together and the other apart."""
    n = len(labels)
    table = coo_matrix((np.ones(n), (labels, np.unique(others, return_inverse=True)[1].ravel()))).toarray()
    together = (table.sum(axis=1) ** 2).sum() + (table.sum(axis=0) ** 2).sum()
    return float((together / 2 - (table**2).sum()) / (n * (n - 1) / 2))
