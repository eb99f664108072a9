"""What a model of parts that nobody named knows of their regions, so that it finds them again."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from ..learning.part_mixture import PartMixture
from ..mesh.triangle_mesh import TriangleMesh
from ..poses.pose_cache import Workpiece
from ..progress import Progress
from .labeler import Labeler
from .region_atlas import RegionAtlas

FIRST_ROUND = 0.7
"""Share of the time that is left for regions after which a round of finding them ends; mostly there is one."""

MERGING_ROUNDS = 6
"""Most times that regions are found, each time without a segment that was found nowhere."""


def recognized_parts(
    labeler_of: Callable[[PartMixture], Labeler],
    learned: PartMixture,
    poses: Sequence[Workpiece],
    rest: TriangleMesh | None,
    progress: Progress,
) -> tuple[PartMixture, tuple[RegionAtlas, RegionAtlas]]:
    """Atlases of the regions of the learned poses, and the parts without segments that are found nowhere.

    A small kind of part may be lost when borders are smoothed: then it is merged, and another part split.

    Parameters
    ----------
    labeler_of
        Gives the labeler of learned parts.
    learned : PartMixture
    poses
        The learned poses.
    rest : TriangleMesh or None
        See `PoseSegmentation.fit`.
    progress : Progress
    """
    assert learned.grouping is not None
    for round_ in range(MERGING_ROUNDS):
        labeler = labeler_of(learned)
        atlases = labeler.atlases(poses, rest, progress.part(0.0, FIRST_ROUND, "regions"))
        progress = progress.part(FIRST_ROUND, 1.0)
        lost = sorted(set(range(labeler.n_segments)) - set(atlases[1].traits.segment.tolist()))
        if not lost or learned.of_bodies or round_ == MERGING_ROUNDS - 1:
            break  # the tree that is returned is the one that the atlases are of
        learned = replace(learned, grouping=learned.grouping.without(lost[-1], labeler.n_segments))
    return learned, atlases
