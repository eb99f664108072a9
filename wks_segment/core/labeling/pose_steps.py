"""Which poses of a mesh are labeled together, and which of them vote."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..poses.pose_cache import Workpiece
from ..poses.pose_signature import PoseSignature, of_one_mesh
from ..progress import Progress


def pose_signatures(poses: Sequence[Workpiece]) -> list[PoseSignature]:
    """The described poses without their intermediate results."""
    return [workpiece.pose for workpiece in poses]


def spread_over(poses: Sequence[Workpiece], most: int) -> list[int]:
    """Numbers of at most so many of the poses: the first, the last, and some between."""
    return sorted(set(np.linspace(0, len(poses) - 1, most).round().astype(int).tolist()))


def steps_of(poses: Sequence[Workpiece], progress: Progress) -> list[tuple[Sequence[Workpiece], Progress]]:
    """Poses whose regions are found together, all with the same faces or each by itself, and the progress of each."""
    if of_one_mesh(pose_signatures(poses)):
        return [(poses, progress)]
    return [([pose], progress.part(i / len(poses), (i + 1) / len(poses))) for i, pose in enumerate(poses)]
