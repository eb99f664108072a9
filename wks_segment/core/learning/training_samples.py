"""The samples that a mixture is fitted to: standardized signatures at the vertices of all training poses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..mesh.triangle_mesh import BoolArray, FloatArray, IntArray
from ..message import Message
from ..poses.pose_cache import Workpiece
from ..spectral.laplacian import unit_area_masses
from .gaussian_mixture import drawn_evenly
from .parameters import effective, least_segments
from .standardizer import Standardizer

MAX_SAMPLES = 20_000
"""Maximum number of samples; if there are more vertices, samples are drawn evenly by area. The time of a fit grows with
this number."""


@dataclass(frozen=True)
class TrainingSamples:
    """Standardized signatures at vertices of all training poses.

    Attributes
    ----------
    signature : (n, d) array
    shares : (n,) array
        Share of each sample in the area, which sum to 1. Each pose has the same sum, whatever its size and number of
        vertices.
    pose : (n,) int array
        Index of the pose that each sample is from.
    vertex : (n,) int array
        Its vertex on the surface of this pose.
    standardizer : Standardizer
        Fitted to the signatures.
    standardized : (n, d) array of float64
        The signatures after the standardizer.
    """

    signature: FloatArray
    shares: FloatArray
    pose: IntArray
    vertex: IntArray
    standardizer: Standardizer
    standardized: FloatArray

    @classmethod
    def of(cls, poses: Sequence[Workpiece], parameters: Mapping[str, Any]) -> TrainingSamples:
        """All vertices of the surfaces of the poses, or samples of them if there are too many.

        ValueError if there are fewer vertices than segments.
        """
        weights = np.concatenate([unit_area_masses(pose.surface.mesh) for pose in poses])
        n_segments = parameters["n_segments"]
        if least_segments(n_segments) > len(weights):
            raise ValueError(
                Message(
                    "n_segments is {segments}, but the poses have only {count} vertices",
                    segments=n_segments,
                    count=len(weights),
                )
            )
        shares = weights / weights.sum()
        index = np.repeat(np.arange(len(poses)), [len(pose.signature) for pose in poses])
        vertex = np.concatenate([np.arange(len(pose.signature)) for pose in poses])
        signatures = [pose.signature for pose in poses]
        if len(shares) > MAX_SAMPLES:
            drawn = drawn_evenly(shares, MAX_SAMPLES)
            starts = np.cumsum([0, *(len(signature) for signature in signatures)])
            first = np.searchsorted(drawn, starts)
            # Drawn from each pose before they are joined: all signatures together would take several times the memory.
            signatures = [
                signature[drawn[first[i] : first[i + 1]] - starts[i]] for i, signature in enumerate(signatures)
            ]
            shares, index, vertex = np.full(MAX_SAMPLES, 1 / MAX_SAMPLES), index[drawn], vertex[drawn]
        signature = np.concatenate(signatures)
        standardizer = Standardizer.fit(
            signature, shares, effective(parameters, "scaling"), unit_spread=parameters["preset"] == "paper"
        )
        return cls(signature, shares, index, vertex, standardizer, standardizer.transform(signature, np.float64))

    def only(self, chosen: BoolArray) -> TrainingSamples:
        """Some of the samples, with the same standardizer; their shares sum to 1 again."""
        shares = self.shares[chosen]
        return replace(
            self,
            signature=self.signature[chosen],
            shares=shares / shares.sum(),
            pose=self.pose[chosen],
            vertex=self.vertex[chosen],
            standardized=self.standardized[chosen],
        )

    @property
    def n_poses(self) -> int:
        """Number of poses that have samples."""
        return len(np.unique(self.pose))
