"""Kinds of the parts of a body that was not learned: it is cut by its own shape, and each part recognized as a whole.

Bodies differ more than poses of one body, and a signature at a single place says little on another one. So a model of
several bodies decides on whole parts: by the signatures on all of their faces, and by their areas.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ..mesh.triangle_mesh import FloatArray
from ..parts.evidence import Evidence
from ..parts.kind_sizes import KindSizes
from ..parts.kinds import grow
from ..parts.part_graph import PartGraph
from ..poses.pose_cache import Workpiece
from ..progress import Progress

OWN_PARTS, NO_LIMIT = 0.0, 10**9
"""Log-odds down to which the regions of a mesh grow, and more regions than there are."""
TEMPER, MOST_UNLIKE = 5.0, 12.0
"""Log-likelihoods of a signature are divided by the first, since its energies tell much the same, and are at most the
second below the best."""
SIZE_WEIGHT = 0.3
"""Weight of the logarithm of the density of a part's area among the parts of a kind."""


def kinds_of_own_parts(
    poses: Sequence[Workpiece], log_likelihoods: Callable[[Workpiece], FloatArray], sizes: KindSizes, progress: Progress
) -> FloatArray:
    """(m, k) posteriors of the kinds of parts on the faces of a mesh, the same all over each part.

    Parameters
    ----------
    poses
        Of one mesh with m faces.
    log_likelihoods
        Gives the (n', k) log-density of each kind at the vertices of a pose.
    sizes : KindSizes
        Of the kinds.
    progress : Progress
    """
    evidence = Evidence.of(poses, None, progress)
    graph = PartGraph.of(evidence, np.zeros((len(evidence.areas), 1)))
    grow(graph, OWN_PARTS, NO_LIMIT)
    part = np.searchsorted(graph.regions, graph.region_of_faces())
    areas = graph.areas[graph.regions]
    total = np.zeros((len(areas), len(sizes.mean)))
    for pose in poses:
        on_faces = pose.surface.to_faces(log_likelihoods(pose)) * evidence.areas[:, None]
        np.add.at(total, part, on_faces)
    mean = total / (len(poses) * areas[:, None])
    unlike = np.minimum((mean.max(axis=1, keepdims=True) - mean) / TEMPER, MOST_UNLIKE)
    deviation = (np.log(areas)[:, None] - sizes.mean) / sizes.spread
    logs = -unlike - SIZE_WEIGHT * deviation**2 / 2
    posteriors = np.exp(logs - logs.max(axis=1, keepdims=True))
    return np.asarray((posteriors / posteriors.sum(axis=1, keepdims=True))[part])
