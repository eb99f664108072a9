"""Parts by shape and motion alone: `python -m benchmarks.own_parts DATA [--signatures CACHE]`.

Measures `core/parts`, which learning begins with, without any model: the Rand-index error of each shape of nine
Princeton classes cut by itself, and bones whole, segments pure and borders at joints of rigged characters whose kinds
of parts are merged to eight. DATA is a folder with `psb`, `rigged` and `characters`. Prints two Markdown tables.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from benchmarks import agreement, part_measures, princeton, rigs
from benchmarks.speed import table_row
from wks_segment.core import DiskCache, PoseSegmentation, TriangleMesh, connect
from wks_segment.core.mesh.triangle_mesh import FloatArray, IntArray, repeats_a_vertex
from wks_segment.core.parts.evidence import Evidence
from wks_segment.core.parts.kinds import find_kinds, grow
from wks_segment.core.parts.part_graph import PartGraph
from wks_segment.core.poses.pose_cache import Workpiece
from wks_segment.core.progress import Progress

N_SEGMENTS = 8
LEAST_LIKENESS, NO_LIMIT = 0.0, 10_000
"""Log-odds down to which the regions of a single shape grow, and more regions than there are."""
AXES, WHITENING, LEAST_VARIANCE = 20, 0.25, 1e-2
"""Number of principal axes of the signatures along which regions are compared, and the power of their variance, with a
little added, that they are divided by."""


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=Path, metavar="DATA")
    parser.add_argument("--output", type=Path, default=Path("demo/rigs"))
    parser.add_argument("--signatures", type=Path, help="folder to keep signatures in, for further runs")
    options = parser.parse_args()
    print(f"| class | error | parts | people against each other | their parts |\n|{'---|' * 5}")
    rows = [of_class(options.data / "psb", name, options.signatures) for name in princeton.CLASSES]
    print(
        table_row(
            [
                "**mean**",
                f"**{np.mean([row[0] for row in rows]):.3f}**",
                "",
                f"{np.mean([row[1] for row in rows]):.3f}",
                "",
            ]
        )
    )
    print(f"\n| character | kinds | bones whole | segments pure | border at joints |\n|{'---|' * 5}", flush=True)
    paths = rigs.files([options.data / "rigged", options.data / "characters"])
    measures = [of_rig(rigs.load(path, options.output / "cache"), options.signatures) for path in paths]
    print(table_row([f"**mean of {len(paths)}**", "", *(f"{value:.3f}" for value in np.nanmean(measures, axis=0))]))


def of_class(folder: Path, name: str, signatures: Path | None) -> tuple[float, float]:
    """Error of the shapes of a class, each cut by itself, and of people against each other; prints the row."""
    truth, described = princeton.read(folder, name, signatures)
    errors, n_parts, of_people, n_theirs = [], [], [], []
    for shape, pose in described.items():
        part = parts_of(Workpiece(pose))
        people = truth[shape]["human_segmentations"]
        errors.append(np.mean([agreement.rand_index_error(part, person) for person in people]))
        n_parts.append(part.max() + 1)
        of_people.append(agreement.of_people(people))
        n_theirs.append(np.mean([len(np.unique(person)) for person in people]))
    cells = [name, f"{np.mean(errors):.3f}", f"{np.mean(n_parts):.1f}", f"{np.mean(of_people):.3f}"]
    print(table_row([*cells, f"{np.mean(n_theirs):.1f}"]), flush=True)
    return float(np.mean(errors)), float(np.mean(of_people))


def parts_of(pose: Workpiece) -> IntArray:
    """(m,) part of each face of a single pose."""
    evidence = Evidence.of([pose], None, Progress())
    graph = PartGraph.of(evidence, np.zeros((len(evidence.areas), 1)))
    grow(graph, LEAST_LIKENESS, NO_LIMIT)
    return np.searchsorted(graph.regions, graph.region_of_faces())


def of_rig(rig: rigs.Rig, signatures: Path | None) -> list[float]:
    """Measures of a character with `N_SEGMENTS` kinds of parts; prints the row."""
    cache = None if signatures is None else DiskCache(signatures)
    learned, rest = rig.learned, rig.rest_mesh
    connection = connect(*learned, rest=rest)
    described = PoseSegmentation().describe_all(learned, [connection] * len(learned), cache=cache)
    poses = [Workpiece(pose) for pose in described]
    evidence = Evidence.of(poses, rest, Progress(), cache)
    kinds = find_kinds([evidence], [_projected(evidence)], N_SEGMENTS, Progress())
    labels = merged(kinds.of_faces[0], kinds.merges, N_SEGMENTS)
    welded = connection.welded[rig.faces]
    proper = ~repeats_a_vertex(welded)
    borders = TriangleMesh(rig.rest, welded[proper])
    found = [
        part_measures.bones_whole(labels, rig.bone, rest.face_areas),
        part_measures.segments_pure(labels, rig.bone, rest.face_areas),
        part_measures.border_at_joints(borders, labels[proper], rig.bone[proper]),
    ]
    print(table_row([rig.name, str(len(kinds.merges) + 1), *(f"{value:.3f}" for value in found)]), flush=True)
    return found


def merged(kind: IntArray, merges: Sequence[Sequence[int]] | IntArray, number: int) -> IntArray:
    """(m,) group of each face, from 0, when kinds are merged until `number` of them are left."""
    owner = np.arange(len(merges) + 1)
    for kept, gone in merges[: max(len(owner) - number, 0)]:
        owner[owner == gone] = kept
    return np.unique(owner[kind], return_inverse=True)[1].ravel()


def _projected(evidence: Evidence) -> FloatArray:
    """(m, AXES) signatures of the faces along their principal axes, of about equal variance."""
    in_poses = [pose.surface.to_faces(np.log(pose.signature + 1)) for pose in evidence.poses]
    values, shares = np.mean(in_poses, axis=0, dtype=np.float64), evidence.areas / evidence.areas.sum()
    centered = values - shares @ values
    centered /= np.sqrt(shares @ centered**2) + np.finfo(float).eps
    variances, axes = np.linalg.eigh((centered * shares[:, None]).T @ centered)
    chosen = slice(None, -AXES - 1, -1)
    return np.asarray(centered @ (axes[:, chosen] / (np.maximum(variances[chosen], 0) + LEAST_VARIANCE) ** WHITENING))


if __name__ == "__main__":
    main()
    sys.stdout.flush()
    os._exit(0)  # some versions of bpy crash at a normal exit
