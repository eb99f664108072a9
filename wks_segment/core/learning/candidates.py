"""Mixtures laid out on the poses that they were learned from: all of learning that does not ask for the number of
segments. It takes most of the time that is left when signatures are known, and so it is kept beside them."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from ..geometry.heat_flow import HeatFlow
from ..mesh.adjacency import FaceAdjacency
from ..mesh.triangle_mesh import FloatArray, IntArray
from ..poses.pose_signature import PoseSignature
from .gaussian_mixture import CovarianceType, GaussianMixture, drawn_evenly
from .merge_tree import Contacts, Ground

VERSION = 1
"""To be raised whenever the same poses and settings give another layout than before."""
COMPARED = 4_000
"""Faces on which the labels of the learned poses are compared."""
LAID = 0.8
"""Share of the time of a pose when it is laid out, see `Ground`; the rest is to lay the mixtures on it."""
SMOOTHING_LENGTH = 0.03
"""Width of the smoothing along borders at smoothness 1, in units of the square root of the area."""
_TYPES: tuple[CovarianceType, ...] = get_args(CovarianceType)


@dataclass(frozen=True)
class Layout:
    """Mixtures that may do, on the poses that they were learned from.

    Attributes
    ----------
    mixtures
        In the space of standardized signatures.
    grounds
        Of each pose.
    contacts
        Of each mixture's components, mean over the poses.
    likeliest
        For each mixture and pose, (m,) the component of each face.
    samples
        For each mixture and pose, (f, K) smoothed posteriors of some faces, each of which stands for as much of the
        area; None unless the poses are several of one mesh.
    """

    mixtures: Sequence[GaussianMixture]
    grounds: Sequence[Ground]
    contacts: Sequence[Contacts]
    likeliest: Sequence[Sequence[IntArray]]
    samples: Sequence[Sequence[FloatArray]] | None

    @classmethod
    def of(
        cls,
        poses: Sequence[PoseSignature],
        mixtures: Sequence[GaussianMixture],
        standardized: Callable[[FloatArray], FloatArray],
        tick: Callable[[float], None],
    ) -> Layout:
        """Lay mixtures on poses; `standardized` leads from the signature of a pose to what enters the mixture."""
        contacts: list[list[Contacts]] = [[] for _ in mixtures]
        likeliest: list[list[IntArray]] = [[] for _ in mixtures]
        samples: list[list[FloatArray]] = [[] for _ in mixtures]
        grounds = []
        first = poses[0].surface.original
        drawn = drawn_evenly(first.face_areas / first.area, COMPARED) if of_one_mesh(poses) else None
        for i, pose in enumerate(poses):

            def of_pose(share: float, begun: int = i) -> None:
                tick((begun + share) / len(poses))

            of_pose(0.0)
            ground = Ground.of(pose.surface, lambda share, of_pose=of_pose: of_pose(LAID * share))  # type: ignore[misc]
            on_pose = standardized(pose.signature)
            grounds.append(ground)
            flow = HeatFlow(pose.surface.mesh, SMOOTHING_LENGTH)
            for j, mixture in enumerate(mixtures):
                of_pose(LAID + (1 - LAID) * j / len(mixtures))
                of_faces = pose.surface.to_faces(flow.smooth(mixture.posteriors(on_pose)))
                contacts[j].append(Contacts.on(ground, of_faces))
                likeliest[j].append(of_faces.argmax(axis=1))
                if drawn is not None:
                    samples[j].append(of_faces[drawn])
        means = [Contacts.mean(found) for found in contacts]
        if drawn is None:
            return cls(mixtures, grounds, means, likeliest, None)
        means = [mean.with_changes(np.stack(kept)) for mean, kept in zip(means, samples, strict=True)]
        return cls(mixtures, grounds, means, likeliest, samples)

    def arrays(self) -> dict[str, NDArray[Any]]:
        """What a file keeps; see `of_arrays`."""
        found: dict[str, NDArray[Any]] = {"compared": np.array(self.samples is not None)}
        for i, ground in enumerate(self.grounds):
            found |= {f"lengths_{i}": ground.lengths, f"part_{i}": ground.part}
        for j, mixture in enumerate(self.mixtures):
            found[f"type_{j}"] = np.array(_TYPES.index(mixture.covariance_type))
            found |= {f"{name}_{j}": getattr(mixture, name) for name in ("weights", "means", "covariances")}
            found |= {f"{name}_{j}": getattr(self.contacts[j], name) for name in Contacts.__dataclass_fields__}
            for i in range(len(self.grounds)):
                found[f"likeliest_{j}_{i}"] = self.likeliest[j][i].astype(np.uint16)
                if self.samples is not None:
                    found[f"samples_{j}_{i}"] = self.samples[j][i]
        return found

    @classmethod
    def of_arrays(cls, poses: Sequence[PoseSignature], arrays: Mapping[str, NDArray[Any]]) -> Layout:
        """From what `arrays` gave, and the poses that it was made from; KeyError or ValueError if it is not that."""
        grounds, every = [], range(len(poses))
        for i, pose in enumerate(poses):
            adjacency = FaceAdjacency.of(pose.surface.welded_faces, pose.surface.original.vertices)
            grounds.append(Ground(pose.surface, adjacency, arrays[f"lengths_{i}"], arrays[f"part_{i}"]))
        numbers = range(sum(name.startswith("type_") for name in arrays))
        return cls(
            [
                GaussianMixture(
                    _TYPES[int(arrays[f"type_{j}"])],
                    *(arrays[f"{name}_{j}"] for name in ("weights", "means", "covariances")),
                )
                for j in numbers
            ],
            grounds,
            [Contacts(*(arrays[f"{name}_{j}"] for name in Contacts.__dataclass_fields__)) for j in numbers],
            [[arrays[f"likeliest_{j}_{i}"].astype(np.int64) for i in every] for j in numbers],
            [[arrays[f"samples_{j}_{i}"] for i in every] for j in numbers] if arrays["compared"] else None,
        )


def layout_key(poses: Sequence[PoseSignature], settings: Sequence[Any]) -> str:
    """A name for the layout on poses with settings: another one if anything that enters it differs."""
    digest = hashlib.blake2b(digest_size=20)
    digest.update(repr(("layout", VERSION, len(poses), *settings)).encode())
    for pose in poses:
        for name, array in pose.arrays().items():
            # Shapes keep apart what would be the same row of bytes.
            digest.update(repr((name, array.shape, array.dtype.str)).encode())
            digest.update(np.ascontiguousarray(array).data)
    return digest.hexdigest()


def of_one_mesh(poses: Sequence[PoseSignature]) -> bool:
    """Whether several poses have the same faces."""
    faces = [pose.surface.original.faces for pose in poses]
    return len(poses) > 1 and all(np.array_equal(faces[0], other) for other in faces[1:])
