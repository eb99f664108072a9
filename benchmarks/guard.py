"""Guard against slow stages: `python -m benchmarks.guard [--update]`; fails if a stage has more to do than before.

Learns, applies and changes settings on small meshes that are made here, as the buttons do, and counts expensive
operations in each stage: factorizations, solves, dense eigenproblems, kd-tree queries, rounds of k-means, … Counts, not
seconds, so that a busy machine gives the same. They are compared with `guard_counts.json`, which `--update` writes: do
so when a change is meant to cost what it costs, and look at the difference. CI runs it.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import bpy

import wks_segment.blender
from benchmarks import shapes
from benchmarks.counting import Counter, Counts
from wks_segment.blender.workflow.live_session import session_of
from wks_segment.blender.workflow.report import Report
from wks_segment.core import PoseSegmentation, TriangleMesh, connect
from wks_segment.core.draft.segments import draft
from wks_segment.core.progress import Progress

KEPT = Path(__file__).with_name("guard_counts.json")
"""The kept counts."""
MARGIN = 1.25
"""A count fails above this multiple of the kept one. Rounding differs between processors and may cost a round or two; a
stage that is done twice has twice the count."""
DIGITS = 2
"""Digits of a kept count: further ones change from run to run, where a thread waits for another one."""
LEARNED, BODIES, APPLIED = 4_000, (3_000, 3_500), 4_000
"""Vertices of the meshes: enough for the fast eigensolver, so few that all takes half a minute."""
PAIRS, FEW_PAIRS = 200, 100
"""Eigenpairs of poses of one mesh, and of all others: the usual 300 would make the meshes twice as large."""
CHANGES: tuple[dict[str, Any], ...] = ({"n_segments": 5}, {"smoothness": 0.7}, {"sides": "one"}, {"sides": "two"})
"""Changes of settings that labels follow."""


def main() -> None:
    """Count, and compare or update."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--update", action="store_true", help="write the counts as the kept ones")
    options = parser.parse_args()
    wks_segment.blender.register()
    code = 1
    try:
        found = count_all()
        if options.update:
            KEPT.write_text(json.dumps(rounded(found), indent=1, sort_keys=True) + "\n", encoding="utf-8")
            print(f"{len(found)} stages written to {KEPT.name}")
            code = 0
        else:
            text, code = compared(json.loads(KEPT.read_text(encoding="utf-8")), found)
            print(text)
    except Exception:
        traceback.print_exc()
    finally:
        wks_segment.blender.unregister()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)  # some versions of bpy hang at exit


def count_all() -> Counts:
    """Counts of all jobs, each by "job: stage"."""
    counts: Counts = {}
    for job in (learn_poses, learn_bodies, learn_as_the_paper, describe_exactly, first_colors):
        bpy.ops.wm.read_homefile(use_empty=True)
        session_of(bpy.context).cache.clear()
        bpy.context.scene.wks_segment.live = False
        job(counts)
    return counts


def learn_poses(counts: Counts) -> None:
    """Three poses of one mesh, whose labels then follow settings; the model labels two other bodies."""
    for i in range(3):
        add(shapes.body(LEARNED, bend=0.3 * i), f"Pose {i + 1}")
    settings = bpy.context.scene.wks_segment
    settings.source, settings.n_eigenpairs = "OBJECTS", PAIRS
    with counting(counts, "learn"):
        bpy.ops.wks_segment.learn()
    session = session_of(bpy.context)
    for change in CHANGES:
        for name, value in change.items():
            setattr(settings, name, value)
        with counting(counts, "live"):
            update = session.updated(bpy.context)
            update.compute(Progress())
            session.write_all(update)
    bpy.ops.object.select_all(action="DESELECT")
    add(shapes.with_islands(shapes.body(APPLIED, irregular=True)), "Islands")
    add(shapes.thinned(shapes.body(APPLIED, bend=0.2)), "Thin")
    with counting(counts, "apply"):
        bpy.ops.wks_segment.apply()


def learn_bodies(counts: Counts) -> None:
    """Two bodies with meshes of their own, and a third one that is cut by its own shape."""
    for i, n_vertices in enumerate(BODIES):
        add(shapes.body(n_vertices, bend=0.2 * i), f"Body {i + 1}")
    settings = bpy.context.scene.wks_segment
    settings.source, settings.n_eigenpairs = "OBJECTS", FEW_PAIRS
    with counting(counts, "learn bodies"):
        bpy.ops.wks_segment.learn()
    bpy.ops.object.select_all(action="DESELECT")
    add(shapes.with_border(shapes.body(APPLIED)), "Border")
    with counting(counts, "apply to a body"):
        bpy.ops.wks_segment.apply()


def learn_as_the_paper(counts: Counts) -> None:
    """One pose with the paper's setting, which fits its mixture by EM."""
    add(shapes.body(BODIES[0]), "Pose")
    settings = bpy.context.scene.wks_segment
    settings.source, settings.preset, settings.n_eigenpairs = "OBJECTS", "paper", FEW_PAIRS
    with counting(counts, "learn as the paper"):
        bpy.ops.wks_segment.learn()


def describe_exactly(counts: Counts) -> None:
    """One body with the exact eigensolver."""
    with counting(counts, "exact eigenpairs"):
        PoseSegmentation(n_eigenpairs=FEW_PAIRS, accuracy="exact").describe(shapes.body(BODIES[0]))


def first_colors(counts: Counts) -> None:
    """A draft of three poses of one mesh."""
    poses = [shapes.body(LEARNED, bend=0.3 * i) for i in range(3)]
    connection = connect(*poses)
    with counting(counts, "first colors"):
        draft(PoseSegmentation(), poses, [connection] * len(poses))


def add(mesh: TriangleMesh, name: str) -> None:
    """Add a selected object to the scene, and make it active."""
    data = bpy.data.meshes.new(name)
    data.from_pydata(mesh.vertices, [], mesh.faces)
    obj = bpy.data.objects.new(name, data)
    bpy.context.collection.objects.link(obj)
    obj.select_set(True)
    bpy.context.view_layer.objects.active = obj


@contextmanager
def counting(counts: Counts, job: str) -> Iterator[None]:
    """Add what the block does to counts, by the stages of its report."""
    with Counter() as counter, stages_counted(counter):
        yield
    for stage, found in counter.counts.items():
        kept = counts.setdefault(f"{job}: {stage}", {})
        for name, count in found.items():
            kept[name] = kept.get(name, 0) + count


@contextmanager
def stages_counted(counter: Counter) -> Iterator[None]:
    """In this block the stages of a report are those of the counter as well."""
    timed: Callable[..., Any] = Report.stage

    @contextmanager
    def counted(report: Report, name: str) -> Iterator[None]:
        with counter.stage(name), timed(report, name):
            yield

    setattr(Report, "stage", counted)  # noqa: B010  # mypy refuses an assignment
    try:
        yield
    finally:
        setattr(Report, "stage", timed)  # noqa: B010


def rounded(counts: Counts) -> Counts:
    """The counts with the digits that are kept."""
    return {
        stage: {name: int(float(f"{count:.{DIGITS - 1}e}")) for name, count in of_stage.items()}
        for stage, of_stage in counts.items()
    }


def compared(kept: Counts, found: Counts) -> tuple[str, int]:
    """What to print about counts, and the exit code: 1 if one has grown by more than the margin."""
    grown, fallen = changes(kept, found), changes(found, kept)
    n_counts = sum(map(len, found.values()))
    lines = [f"{n_counts} counts in {len(found)} stages: {len(grown)} have grown, {len(fallen)} have fallen"]
    if grown:
        lines += ["", "| stage | count | kept | found |", "| --- | --- | --- | --- |"]
        lines += [f"| {stage} | {name} | {before:,} | {now:,} |" for stage, name, before, now in grown]
        lines += ["", "Find out what takes more. If it is worth that: python -m benchmarks.guard --update"]
    elif fallen:
        lines += ["Keep what was gained: python -m benchmarks.guard --update"]
    return "\n".join(lines), int(bool(grown))


def changes(kept: Counts, found: Counts) -> list[tuple[str, str, int, int]]:
    """Stage, name, kept and found count of all that are above the kept ones by more than the margin."""
    return [
        (stage, name, kept.get(stage, {}).get(name, 0), count)
        for stage, of_stage in found.items()
        for name, count in of_stage.items()
        if count > MARGIN * kept.get(stage, {}).get(name, 0)
    ]


if __name__ == "__main__":
    main()
