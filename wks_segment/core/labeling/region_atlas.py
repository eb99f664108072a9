"""The learned regions, and which of them each region of a pose is: the same in every pose and on every meshing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..mesh.triangle_mesh import FloatArray, IntArray
from .matching import matched
from .sides import region_sides
from .traits import Traits, deviation_of_numbered, mean_of_numbered

USUAL_NOISE = {"area": 0.5, "signature": 0.5, "handedness": 0.5, "distance": 0.1}
"""Standard deviation of traits from pose to pose, if only one pose was learned: of the logarithm of the area, of the
signature, of handedness in units of its root mean square, and of distances."""
LEAST_NOISE = {"area": 0.1, "signature": 0.1, "handedness": 0.2, "distance": 0.03}
"""Lower bounds of the same: learned poses that are nearly equal must not make every other pose look foreign."""


@dataclass(frozen=True)
class RegionAtlas:
    """The learned regions, and how to recognize them.

    Attributes
    ----------
    n_groups : int
        Number of groups of components whose connected regions these are.
    traits : Traits
        Means over the learned poses.
    side : (r,) int array
        1: left, which is +x as in Blender; −1: right; 0: neither.
    noise : (4,) array
        Standard deviations of log area, signature, handedness and distance from pose to pose.
    """

    n_groups: int
    traits: Traits
    side: IntArray
    noise: FloatArray

    @classmethod
    def learned(
        cls,
        n_groups: int,
        poses: Sequence[Traits],
        centers: FloatArray,
        alike: bool = False,
        known: Sequence[IntArray | None] = (),
    ) -> RegionAtlas:
        """Learn the regions of one or several poses.

        Parameters
        ----------
        n_groups : int
        poses
            Traits of the regions of each pose.
        centers : (r, 3) array
            Centers of the regions of the first pose, at rest if possible: they tell left from right.
        alike : bool
            Whether the poses are of one mesh and have their regions in the same order.
        known, optional
            For each pose the number of each region, if it is known; None if it is not.
        """
        side = np.zeros(len(centers), dtype=np.int64)
        atlas = cls(n_groups, poses[0], side, _in_units(USUAL_NOISE, poses[0]))
        # The mean over poses recognizes regions of each pose more reliably than the first pose alone.
        for _ in range(2):
            numbers = [np.arange(len(pose.segment)) if alike else atlas.numbers_of(pose) for pose in poses]
            for i, given in enumerate(known):
                numbers[i] = numbers[i] if given is None else given
            mean = mean_of_numbered(atlas.traits, poses, numbers)
            noise = _in_units(USUAL_NOISE, mean)
            if len(poses) > 1:
                noise = np.maximum(deviation_of_numbered(mean, poses, numbers), _in_units(LEAST_NOISE, mean))
            atlas = cls(n_groups, mean, side, noise)
        return replace(atlas, side=region_sides(centers, poses[0].segment, atlas.mirrored()))

    def numbers_of(self, traits: Traits) -> IntArray:
        """(r',) number of the learned region that each region of a pose is; new regions get numbers from r."""
        return matched(self.traits, traits, self.noise)

    def sides_of(self, numbers: IntArray) -> IntArray:
        """Side of each region by its number; 0 for a region that was not learned."""
        return np.where(numbers < len(self.side), self.side[np.minimum(numbers, len(self.side) - 1)], 0)

    def mirrored(self) -> IntArray:
        """(r,) region that each region becomes in the mirror image of the character; r or more for none."""
        return self.numbers_of(replace(self.traits, handedness=-self.traits.handedness))

    def arrays(self, kind: str) -> dict[str, FloatArray | IntArray]:
        """Arrays for a model file; each name begins with the kind of region. `of_arrays` reads them."""
        return {
            f"{kind}_groups": np.array(self.n_groups),
            f"{kind}_side": self.side,
            f"{kind}_noise": self.noise,
            **{f"{kind}_{name}": getattr(self.traits, name) for name in Traits.__dataclass_fields__},
        }

    @classmethod
    def of_arrays(cls, arrays: Mapping[str, FloatArray], kind: str) -> RegionAtlas:
        """The atlas in arrays that `arrays` made."""
        segment, side = (arrays[f"{kind}_{name}"].astype(np.int64) for name in ("segment", "side"))
        area, signature, handedness, distance = (
            arrays[f"{kind}_{name}"] for name in ("area", "signature", "handedness", "distance")
        )
        traits = Traits(segment, area, signature, handedness, distance)
        return cls(int(arrays[f"{kind}_groups"]), traits, side, arrays[f"{kind}_noise"])


def _in_units(noise: Mapping[str, float], traits: Traits) -> FloatArray:
    """(4,) noise of the traits, with the noise of handedness in units of its root mean square."""
    root_mean_square = float(np.sqrt(np.mean(traits.handedness**2))) or 1.0
    return np.array([noise["area"], noise["signature"], noise["handedness"] * root_mean_square, noise["distance"]])
