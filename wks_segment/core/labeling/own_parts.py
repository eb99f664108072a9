"""Kinds of the parts of a body that was not learned: it is cut by its own shape, and each part recognized as a whole.

Bodies differ more than poses of one body, and a signature at a single place says little on another one. So a model of
several bodies decides on whole parts: by the signatures on all of their faces, and by their areas.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ..mesh.triangle_mesh import BoolArray, FloatArray, IntArray, connected_groups
from ..parts.evidence import Evidence
from ..parts.kind_traits import KindTraits
from ..parts.kinds import grow
from ..parts.part_graph import PartGraph
from ..poses.pose_cache import Workpiece
from ..progress import Progress

OWN_PARTS, NO_LIMIT = 0.0, 10**9
"""Log-odds down to which the regions of a mesh grow, and more regions than there are."""
TEMPER, MOST_UNLIKE = 5.0, 12.0
"""Log-likelihoods of a signature are divided by the first, since its energies tell much the same, and are at most the
second below the best."""
NEIGHBOR_WEIGHT = 2.0
"""Weight of the logarithm of the probability that parts of two kinds touch, or do not."""
MOST_SWEEPS = 10
"""Most rounds over all parts. Two or three are usual."""
AREA_WEIGHT = 0.3
"""Weight of the logarithm of the density of a part's area among the parts of a kind."""


@dataclass(frozen=True)
class OwnParts:
    """The r parts of a mesh by its own shape.

    Attributes
    ----------
    part : (m,) int array
        Part of each face.
    posteriors : (r, k) array
        Posteriors of the kinds of each part; rows sum to 1.
    touch : (r, r) bool array
        Which parts touch.
    """

    part: IntArray
    posteriors: FloatArray
    touch: BoolArray

    def wholes(self, group: IntArray) -> tuple[IntArray, IntArray]:
        """(r,) whole that each part belongs to, and the group of each whole, given the (k,) group of each kind.

        Parts of one group that touch are fragments of a whole, except two of one kind: these are repeats of each other,
        as the two jaws of pliers.
        """
        kind = self.posteriors.argmax(axis=1)
        of_parts = (self.posteriors @ np.eye(int(group.max()) + 1)[group]).argmax(axis=1)
        same = self.touch & (of_parts[:, None] == of_parts) & (kind[:, None] != kind)
        whole = connected_groups(np.argwhere(same), len(kind))
        owner = np.zeros(int(whole.max()) + 1, dtype=np.int64)
        owner[whole] = of_parts
        return whole, owner


def own_parts(
    poses: Sequence[Workpiece],
    log_likelihoods: Callable[[Workpiece], FloatArray],
    traits: KindTraits,
    progress: Progress,
) -> OwnParts:
    """Cut a mesh into parts and recognize their kinds.

    Parameters
    ----------
    poses
        Of one mesh with m faces.
    log_likelihoods
        Gives the (n', k) log-density of each kind at the vertices of a pose.
    traits : KindTraits
        Of the kinds.
    progress : Progress
    """
    evidence = Evidence.of(poses, None, progress.part(0.0, 0.3))
    graph = PartGraph.of(evidence, np.zeros((len(evidence.areas), 1)), progress.part(0.3, 1.0))
    grow(graph, OWN_PARTS, NO_LIMIT)
    part = np.searchsorted(graph.regions, graph.region_of_faces())
    areas = graph.areas[graph.regions]
    total = np.zeros((len(areas), len(traits.mean)))
    for pose in poses:
        np.add.at(total, part, pose.surface.to_faces(log_likelihoods(pose)) * evidence.areas[:, None])
    mean = total / (len(poses) * areas[:, None])
    unlike = np.minimum((mean.max(axis=1, keepdims=True) - mean) / TEMPER, MOST_UNLIKE)
    deviation = (np.log(areas)[:, None] - traits.mean) / traits.spread
    alone = -unlike - AREA_WEIGHT * deviation**2 / 2
    touch = graph.touching()
    return OwnParts(part, _with_neighbors(alone, touch, traits.touching), touch)


def _with_neighbors(alone: FloatArray, touch: BoolArray, touching: FloatArray) -> FloatArray:
    """(r, k) posteriors of the kinds of parts, given the kinds of all others.

    Parameters
    ----------
    alone : (r, k) array
        Logarithm of the likelihood of each kind by what the part itself is.
    touch : (r, r) bool array
        Which parts touch.
    touching : (k, k) array
        Probability that parts of two kinds touch.
    """
    # Gain of a kind for each kind of another part that touches, or does not.
    gain_touching, gain_apart = NEIGHBOR_WEIGHT * np.log(touching), NEIGHBOR_WEIGHT * np.log(1 - touching)
    kind = alone.argmax(axis=1)
    everything = alone.copy()
    for _ in range(MOST_SWEEPS):
        before = kind.copy()
        for i in range(len(alone)):
            others = np.arange(len(alone)) != i
            near, far = kind[touch[i] & others], kind[~touch[i] & others]
            everything[i] = alone[i] + gain_touching[:, near].sum(axis=1) + gain_apart[:, far].sum(axis=1)
            kind[i] = everything[i].argmax()
        if (kind == before).all():
            break
    posteriors = np.exp(everything - everything.max(axis=1, keepdims=True))
    return np.asarray(posteriors / posteriors.sum(axis=1, keepdims=True))
