"""How near the progress bar is to the time: `python -m benchmarks.progress`.

For meshes of several sizes, numbers of poses and of eigenpairs: seconds of a processor, with one thread, and the share
of signatures in the time to learn and to label, as measured and as the bar has it. Run it whenever one of the three
gets faster or slower, and fit the constants of `core.poses.describe` anew.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from typing import Any

from benchmarks.shapes import body
from benchmarks.speed import table_row
from wks_segment.core import PoseSegmentation, Workpiece
from wks_segment.core.poses.describe import LABELING, LEARNING

CASES = (
    (162, 300, 3), (642, 300, 1), (642, 30, 3), (642, 100, 3), (2562, 300, 1), (2562, 300, 4), (2562, 600, 2),
    (10242, 300, 3), (10242, 100, 2), (40962, 300, 2),
)  # fmt: skip
"""Vertices, eigenpairs and poses."""


def main() -> None:
    """Print a line for each case."""
    header = ["vertices", "eigenpairs", "poses", "signatures, s", "learning, s", "labels, s"]
    header += ["share in learning", "the bar", "share in labeling", "the bar"]
    print(table_row(header))
    print(table_row(["---"] * len(header)), flush=True)
    PoseSegmentation(4, n_eigenpairs=30).fit([body(162, 0.0)])  # imports
    for n_vertices, n_pairs, n_poses in CASES:
        meshes = [body(n_vertices, 0.3 * i) for i in range(n_poses)]
        model = PoseSegmentation(6, n_eigenpairs=n_pairs)
        described, signatures = timed(partial(model.describe_all, meshes, workers=1))
        _, learning = timed(partial(model.fit, described))
        _, labels = timed(partial(list, map(model.segment_faces, map(Workpiece, described))))
        shares = [
            signatures / (signatures + learning), model.describing_share(meshes, n_poses, LEARNING),
            signatures / (signatures + labels), model.describing_share(meshes, n_poses, LABELING),
        ]  # fmt: skip
        counts = [str(count) for count in (n_vertices, n_pairs, n_poses)]
        seconds = [f"{each:.2f}" for each in (signatures, learning, labels)]
        print(table_row([*counts, *seconds, *(f"{share:.2f}" for share in shares)]), flush=True)


def timed(work: Callable[[], Any]) -> tuple[Any, float]:
    """Result and seconds of a processor."""
    begun = time.process_time()
    result = work()
    return result, time.process_time() - begun


if __name__ == "__main__":
    main()
