"""Candidate mixtures, evaluated on their training poses.

A candidate does not depend on the number of segments. Computing the candidates takes most of the time of a fit whose
signatures are cached, so candidates are cached as well.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from ..geometry.heat_flow import HeatFlow
from ..mesh.adjacency import FaceAdjacency
from ..mesh.triangle_mesh import FloatArray, IntArray
from ..poses.pose_signature import PoseSignature
from ..poses.signature_cache import content_key
from ..progress import Progress
from .gaussian_mixture import CovarianceType, GaussianMixture, drawn_evenly
from .merge_tree import Contacts, PoseGeometry
from .standardizer import Standardizer

CANDIDATES_VERSION = 1
"""To be raised whenever the same poses and settings give other candidates than before."""
COMPARED_FACES = 4_000
"""Number of faces on which the labels of the training poses are compared: drawn evenly by area, so that the error of a
share is below 1 %."""
GEOMETRY_SHARE = 0.8
"""Share of the time of a pose that its `PoseGeometry` takes; the rest is evaluating the mixtures on it."""
SMOOTHING_LENGTH = 0.03
"""Width of the smoothing along borders at smoothness 1, in units of the square root of the area."""
_TYPES: tuple[CovarianceType, ...] = get_args(CovarianceType)
_MIXTURE_ARRAYS = ("weights", "means", "covariances")
_CONTACT_ARRAYS = tuple(Contacts.__dataclass_fields__)


@dataclass(frozen=True)
class Candidate:
    """A mixture and its components on the training poses.

    Attributes
    ----------
    mixture : GaussianMixture
        Of standardized signatures.
    contacts : Contacts
        Mean over the poses.
    likeliest
        For each pose, (m,) likeliest component of each face.
    samples
        For each pose, (f, K) smoothed posteriors of some faces with equal shares of the area; empty unless there are
        several poses of one mesh.
    """

    mixture: GaussianMixture
    contacts: Contacts
    likeliest: Sequence[IntArray]
    samples: Sequence[FloatArray]


@dataclass(frozen=True)
class CandidateSet:
    """Candidate mixtures, and the geometry of the training poses that they are compared on.

    Attributes
    ----------
    geometries
        Of each pose.
    members
        The candidates, at least one.
    """

    geometries: Sequence[PoseGeometry]
    members: Sequence[Candidate]

    @property
    def one_mesh(self) -> bool:
        """Whether the training poses are several poses of one mesh."""
        return len(self.members[0].samples) > 0

    @classmethod
    def of(
        cls,
        poses: Sequence[PoseSignature],
        mixtures: Sequence[GaussianMixture],
        standardizer: Standardizer,
        progress: Progress,
    ) -> CandidateSet:
        """Evaluate mixtures of standardized signatures on poses."""
        contacts: list[list[Contacts]] = [[] for _ in mixtures]
        likeliest: list[list[IntArray]] = [[] for _ in mixtures]
        samples: list[list[FloatArray]] = [[] for _ in mixtures]
        geometries = []
        first = poses[0].surface.original
        drawn = drawn_evenly(first.face_areas / first.area, COMPARED_FACES) if of_one_mesh(poses) else None
        for pose, step in progress.each(poses):
            geometry = PoseGeometry.of(pose.surface, step.part(0.0, GEOMETRY_SHARE))
            geometries.append(geometry)
            standardized = standardizer.transform(pose.signature)
            flow = HeatFlow(pose.surface.mesh, SMOOTHING_LENGTH)
            for j, (mixture, _) in enumerate(step.part(GEOMETRY_SHARE, 1.0).each(mixtures)):
                posteriors = pose.surface.to_faces(flow.smooth(mixture.posteriors(standardized)))
                contacts[j].append(Contacts.on(geometry, posteriors))
                likeliest[j].append(posteriors.argmax(axis=1))
                if drawn is not None:
                    samples[j].append(posteriors[drawn])
        means = [Contacts.mean(of_poses) for of_poses in contacts]
        if drawn is not None:
            means = [mean.with_changes(np.stack(of_poses)) for mean, of_poses in zip(means, samples, strict=True)]
        return cls(geometries, [Candidate(*parts) for parts in zip(mixtures, means, likeliest, samples, strict=True)])

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Arrays by name, to be cached; `of_arrays` reads them."""
        arrays: dict[str, NDArray[Any]] = {"compared": np.array(self.one_mesh)}
        for i, geometry in enumerate(self.geometries):
            arrays |= {f"lengths_{i}": geometry.lengths, f"part_{i}": geometry.cuts}
        for j, candidate in enumerate(self.members):
            arrays[f"type_{j}"] = np.array(_TYPES.index(candidate.mixture.covariance_type))
            arrays |= {f"{name}_{j}": getattr(candidate.mixture, name) for name in _MIXTURE_ARRAYS}
            arrays |= {f"{name}_{j}": getattr(candidate.contacts, name) for name in _CONTACT_ARRAYS}
            arrays |= {f"likeliest_{j}_{i}": labels.astype(np.uint16) for i, labels in enumerate(candidate.likeliest)}
            arrays |= {f"samples_{j}_{i}": posteriors for i, posteriors in enumerate(candidate.samples)}
        return arrays

    @classmethod
    def of_arrays(cls, poses: Sequence[PoseSignature], arrays: Mapping[str, NDArray[Any]]) -> CandidateSet:
        """The candidates in arrays that `arrays` made for the same poses; KeyError or ValueError if there are none."""
        geometries, pose_range = [], range(len(poses))
        for i, pose in enumerate(poses):
            adjacency = FaceAdjacency.of(pose.surface.welded_faces, pose.surface.original.vertices)
            geometries.append(PoseGeometry(pose.surface, adjacency, arrays[f"lengths_{i}"], arrays[f"part_{i}"]))
        compared = arrays["compared"]
        candidates = []
        for j in range(sum(name.startswith("type_") for name in arrays)):
            covariance_type = _TYPES[int(arrays[f"type_{j}"])]
            candidates.append(
                Candidate(
                    GaussianMixture(covariance_type, *(arrays[f"{name}_{j}"] for name in _MIXTURE_ARRAYS)),
                    Contacts(*(arrays[f"{name}_{j}"] for name in _CONTACT_ARRAYS)),
                    [arrays[f"likeliest_{j}_{i}"].astype(np.int64) for i in pose_range],
                    [arrays[f"samples_{j}_{i}"] for i in pose_range] if compared else [],
                )
            )
        return cls(geometries, candidates)


def candidates_key(poses: Sequence[PoseSignature], settings: Sequence[Any]) -> str:
    """Cache key of the candidates for poses and settings: another key if any of them differs in any bit."""
    return content_key(("layout", CANDIDATES_VERSION, len(poses), *settings), *(pose.arrays() for pose in poses))


def of_one_mesh(poses: Sequence[PoseSignature]) -> bool:
    """Whether these are several poses with the same faces."""
    faces = [pose.surface.original.faces for pose in poses]
    return len(poses) > 1 and all(np.array_equal(faces[0], other) for other in faces[1:])
