"""The guard against slow stages: a stage that does its work twice fails, and the table names it."""

import json
from functools import cache

import bpy
import pytest

from benchmarks import guard, shapes
from wks_segment.blender.workflow import pipeline
from wks_segment.core import PoseSegmentation
from wks_segment.core.poses import describe

pytestmark = pytest.mark.usefixtures("scene", "learns_anew")


def counted():
    """Counts of a small job."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    guard.session_of(bpy.context).drop()
    guard.session_of(bpy.context).cache.clear()
    settings = bpy.context.scene.wks_segment
    settings.source, settings.n_segments, settings.n_eigenpairs, settings.n_energies = "OBJECTS", 4, 30, 40
    for i in range(2):
        guard.add(shapes.body(600, bend=0.4 * i), f"Pose {i + 1}")
    counts = {}
    with guard.counting(counts, "learn"):
        assert bpy.ops.wks_segment.learn() == {"FINISHED"}
    return counts


@cache
def counted_before():
    counted()  # what is done once a process
    return json.dumps(guard.rounded(counted()))


@pytest.fixture
def kept():
    return json.loads(counted_before())


def twice(monkeypatch, owner, name):
    """Let a function do its work twice."""
    function = getattr(owner, name)

    def doubled(*arguments, **options):
        function(*arguments, **options)
        return function(*arguments, **options)

    monkeypatch.setattr(owner, name, doubled)


def test_the_same_again_passes(kept):
    assert {"learn: connect", "learn: signature", "learn: mixture", "learn: label", "learn: write"} <= set(kept)
    text, code = guard.compared(kept, counted())
    assert code == 0, text
    assert "0 have grown" in text


@pytest.mark.parametrize(
    ("owner", "name", "stage", "count"),
    [
        (PoseSegmentation, "fit", "learn: mixture", "k-means rounds"),
        (pipeline, "_parts_of", "learn: label", "graph cuts"),
        (describe, "wave_kernel_signature_of", "learn: signature", "factorizations"),
    ],
)
def test_a_doubled_stage_fails(kept, monkeypatch, owner, name, stage, count):
    with monkeypatch.context() as patched:
        twice(patched, owner, name)
        found = counted()
    text, code = guard.compared(kept, found)
    assert code == 1
    rows = [row.strip("| ").split(" | ") for row in text.splitlines() if row.startswith("| learn")]
    assert {row[0] for row in rows} == {stage}, text
    (row,) = (row for row in rows if row[1] == count)
    before, now = (int(number.replace(",", "")) for number in row[2:])
    assert (before, now) == (kept[stage][count], found[stage][count])
    assert now > 1.5 * before
    # And a stage that does less than was kept passes, but is told.
    text, code = guard.compared(found, kept)
    assert code == 0
    assert "--update" in text


def test_a_count_that_is_new_fails(kept):
    found = {stage: dict(of_stage) for stage, of_stage in kept.items()}
    found["learn: write"]["graph cuts"] = 1
    text, code = guard.compared(kept, found)
    assert code == 1
    assert "| learn: write | graph cuts | 0 | 1 |" in text


def test_kept_counts_are_of_the_present_jobs():
    stages = json.loads(guard.KEPT.read_text(encoding="utf-8"))
    jobs = {stage.split(":")[0] for stage in stages}
    assert jobs == {
        "learn",
        "live",
        "apply",
        "learn bodies",
        "apply to a body",
        "learn as the paper",
        "exact eigenpairs",
        "first colors",
    }
    for needed in ("learn: mixture", "learn: signature", "live: label", "apply: signature"):
        assert sum(stages[needed].values()) > 1000
