"""Kinds of the regions of a body that was not learned: it is cut by its own shape, and its regions are recognized.

Bodies differ more than poses of one body, and a signature at a single place says little on another one. So a model of
several bodies decides on regions: by the signatures on all of their faces, and by what are likely parts together.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import deepcopy
from dataclasses import dataclass

import numpy as np

from ..mesh.triangle_mesh import BoolArray, FloatArray, IntArray, connected_groups
from ..parts.evidence import Evidence
from ..parts.kinds import FINEST, MOST_GROWN, grow
from ..parts.part_graph import PartGraph
from ..parts.region_labels import costs_among_others, region_labels, unlikeness
from ..poses.pose_cache import Workpiece
from ..progress import Progress

OWN_PARTS, NO_LIMIT = 0.0, 10**9
"""Log-odds down to which the parts of a mesh grow, and more parts than there are."""
TIES = 3.0
"""What it costs that two regions that touch are of different kinds, for each unit of the log-odds that they are one
part."""


@dataclass(frozen=True)
class OwnParts:
    """The r regions of a mesh, their kinds, and the q parts by its own shape that they make up.

    Attributes
    ----------
    region : (m,) int array
        Region of each face.
    posteriors : (r, k) array
        Posteriors of the kinds of each region; rows sum to 1.
    part : (m,) int array
        Part of each face.
    of_parts : (q, k) array
        Posteriors of the kinds of each part: means over its area.
    touch : (q, q) bool array
        Which parts touch.
    """

    region: IntArray
    posteriors: FloatArray
    part: IntArray
    of_parts: FloatArray
    touch: BoolArray

    def wholes(self, group: IntArray) -> tuple[IntArray, IntArray]:
        """(q,) whole that each part belongs to, and the group of each whole, given the (k,) group of each kind.

        Parts of one group that touch are fragments of a whole, except two of one kind: these are repeats of each other,
        as the two jaws of pliers.
        """
        kind = self.of_parts.argmax(axis=1)
        group_of_parts = (self.of_parts @ np.eye(int(group.max()) + 1)[group]).argmax(axis=1)
        same = self.touch & (group_of_parts[:, None] == group_of_parts) & (kind[:, None] != kind)
        whole = connected_groups(np.argwhere(same), len(kind))
        owner = np.zeros(int(whole.max()) + 1, dtype=np.int64)
        owner[whole] = group_of_parts
        return whole, owner


def own_parts(
    poses: Sequence[Workpiece],
    log_likelihoods: Callable[[Workpiece], FloatArray],
    n_kinds: int,
    progress: Progress,
) -> OwnParts:
    """Cut a mesh into regions and recognize their kinds.

    Parameters
    ----------
    poses
        Of one mesh with m faces.
    log_likelihoods
        Gives the (n', k) log-density of each kind at the vertices of a pose.
    n_kinds : int
        k.
    progress : Progress
    """
    evidence = Evidence.of(poses, None, progress.part(0.0, 0.3))
    graph = PartGraph.of(evidence, np.zeros((len(evidence.areas), 1)), progress.part(0.3, 1.0))
    wholes = deepcopy(graph)
    grow(graph, FINEST, MOST_GROWN)
    region, ties = np.searchsorted(graph.regions, graph.region_of_faces()), TIES * graph.ties()
    areas = graph.areas[graph.regions]
    total = np.zeros((len(areas), n_kinds))
    for pose in poses:
        np.add.at(total, region, pose.surface.to_faces(log_likelihoods(pose)) * evidence.areas[:, None])
    costs = unlikeness(total / (len(poses) * areas[:, None]))
    among_others = costs_among_others(costs, ties, region_labels(costs, ties))
    posteriors = np.exp(among_others.min(axis=1, keepdims=True) - among_others)
    posteriors /= posteriors.sum(axis=1, keepdims=True)
    grow(wholes, OWN_PARTS, NO_LIMIT)
    part = np.searchsorted(wholes.regions, wholes.region_of_faces())
    of_parts = np.zeros((len(wholes.regions), n_kinds))
    np.add.at(of_parts, part, posteriors[region] * evidence.areas[:, None])
    of_parts /= of_parts.sum(axis=1, keepdims=True)
    return OwnParts(region, posteriors, part, of_parts, wholes.touching())
