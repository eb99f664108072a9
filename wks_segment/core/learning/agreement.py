"""Kinds of parts on which several meshes agree.

Each mesh is cut into parts by its own shape, and these are clustered; but the leg of one body may be one part and that
of another two, and one part of the body gets several kinds. So the regions of each mesh are labeled anew, again and
again, by what all *other* meshes say of the kinds: a kind that only one mesh has goes, and parts that are the same get
one kind.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..mesh.triangle_mesh import FloatArray, IntArray
from ..parts.region_labels import region_labels, unlikeness
from .inside_parts import fitted_inside
from .training_samples import TrainingSamples

ROUNDS = 3
"""Most rounds over all meshes. With two, names of parts of five classes agree by 0.717, with three by 0.723 (adjusted
Rand index), without any by 0.692."""
PER_KIND = 5
"""Number of components of the mixture for each kind."""
LEARNING_TIES = 1.0
"""What it costs that two regions that touch are of different kinds, for each unit of the log-odds that they are one
part. With three, as when meshes are labeled, kinds merge that are two."""


def agreed_kinds(
    kinds: Sequence[IntArray],
    ties: Sequence[FloatArray],
    region: Sequence[IntArray],
    training: TrainingSamples,
    axes: FloatArray,
    least: int,
) -> list[IntArray]:
    """(r,) kind of each region of each mesh, as the other meshes say; numbered without gaps.

    Parameters
    ----------
    kinds
        For each mesh, (r,) kinds to begin with.
    ties
        For each mesh, (r, r) log-odds that two regions are one part, 0 where they are rather two.
    region
        For each mesh, (s,) region of each of its training samples.
    training : TrainingSamples
        Of the meshes, each in one pose.
    axes : (d, q) array
        Principal axes of the signatures, for clusters inside a kind.
    least : int
        Number of kinds that must be left: rounds end before there are fewer.
    """
    found = [of_mesh.copy() for of_mesh in kinds]
    kind_of_samples = np.empty(len(training.pose), dtype=np.int64)
    here = [np.flatnonzero(training.pose == i) for i in range(len(kinds))]
    for _ in range(ROUNDS):
        before = found
        for i, samples in enumerate(here):
            kind_of_samples[samples] = before[i][region[i]]
        found = []
        for i, samples in enumerate(here):
            others = training.pose != i
            known = kind_of_samples[others]
            n_components = PER_KIND * len(np.unique(known))
            mixture, kind = fitted_inside(training.only(others), known, axes, n_components, "diag")
            present, group = np.unique(kind, return_inverse=True)
            likelihoods = mixture.group_log_likelihoods(training.standardized[samples], group.ravel(), len(present))
            shares = training.shares[samples]
            sums = np.zeros((len(before[i]), len(present)))
            np.add.at(sums, region[i], likelihoods * shares[:, None])
            areas = np.bincount(region[i], shares, len(before[i]))
            mean = sums / np.maximum(areas, np.finfo(float).tiny)[:, None]
            found.append(present[region_labels(unlikeness(mean), LEARNING_TIES * ties[i])])
        if len(np.unique(np.concatenate(found))) < least:
            found = before
        if all(np.array_equal(*pair) for pair in zip(before, found, strict=True)):
            break
    number = np.unique(np.concatenate(found), return_inverse=True)[1]
    return np.split(number.ravel(), np.cumsum([len(of_mesh) for of_mesh in found])[:-1])
