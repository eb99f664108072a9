"""Batches with Dask: a real scheduler and two workers on this machine, one of which is killed during the batch."""

import contextlib
import json
import os
import re
import subprocess
import sys
import time
import uuid

import psutil
import pytest
from command_line import QUICK, ROOT, lines, run, start, wait_for_lines, write

from wks_segment.batch import BatchError
from wks_segment.core.progress import Progress

FILES = 4
MARK = "WKS_SEGMENT_TEST"
"""Variable of the environment by which the children of a test are known."""
distributed = pytest.importorskip("distributed")


def started(*arguments, until, **environment):
    """Start a process of Dask; return it and the text that matches `until` in what it prints."""
    process = subprocess.Popen(
        [sys.executable, "-m", "distributed.cli.dask_" + arguments[0], *arguments[1:]], text=True, cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(ROOT), **environment}, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
    )  # fmt: skip
    for line in process.stderr:
        if match := re.search(until, line):
            return process, match[0]
    raise AssertionError(f"{arguments}: ended with {process.wait()}")


@pytest.fixture
def cluster(monkeypatch):
    """Address of a scheduler, its two workers, and the scheduler."""
    monkeypatch.setenv(MARK, uuid.uuid4().hex)
    processes = []
    try:
        scheduler, address = started(
            "scheduler", "--host", "127.0.0.1", "--port", "0", "--dashboard-address", ":0", "--no-dashboard",
            until=r"tcp://127\.0\.0\.1:\d+",
        )  # fmt: skip
        processes.append(scheduler)
        for i in range(2):
            worker = started(
                "worker", address, "--no-nanny", "--nthreads", "1", "--name", f"worker-{i}", "--no-dashboard",
                "--host", "127.0.0.1", until="Registered to",
            )[0]  # fmt: skip
            processes.append(worker)
        yield address, processes[1:], scheduler
    finally:
        for process in processes:
            process.kill()
            process.communicate()


def test_nothing_is_lost_when_a_worker_dies(cluster, tmp_path, needs_bpy):
    address, workers, _ = cluster
    inputs = tmp_path / "in"
    inputs.mkdir()
    for i in range(FILES):
        write(inputs / f"{i}.obj", 0.1 * i)
    (inputs / "broken.glb").write_bytes(b"glTF and no more")
    out = tmp_path / "out"
    process = start(
        "batch", "learn", inputs, "--output", out, *QUICK, "--no-thumbnails", "--scheduler", address, "--json"
    )
    wait_for_lines(out, 2, process)
    workers[0].kill()
    output, messages = process.communicate(timeout=120)
    result = json.loads(output)
    assert (process.returncode, result["files"], result["done"]) == (1, FILES + 1, FILES), messages
    assert list(result["failed"]) == [str(inputs / "broken.glb")]
    alone = tmp_path / "alone.json"
    assert run("learn", inputs / f"{FILES - 1}.obj", "--model", alone, *QUICK)[0] == 0
    assert alone.read_bytes() == (out / f"{FILES - 1}.json").read_bytes(), "not the same model as without a cluster"
    assert not (out / ".unfinished").exists()


def children():
    """Processes of the children of this cluster."""
    found = set()
    for each in psutil.process_iter(["cmdline"]):
        with contextlib.suppress(psutil.Error):
            if "batch-child" in (each.info["cmdline"] or ()) and each.environ().get(MARK) == os.environ[MARK]:
                found.add(each.pid)
    return found


def wait_until(holds, seconds=40):
    deadline = time.monotonic() + seconds
    while not holds() and time.monotonic() < deadline:
        time.sleep(0.1)
    return holds()


@pytest.fixture
def hanging(tmp_path):
    """A folder of a file that is done at once, and of one that Blender's importer reads forever."""
    inputs = tmp_path / "in"
    inputs.mkdir()
    write(inputs / "a.obj", 0.1)
    os.mkfifo(inputs / "pipe.mtl")
    for i in range(2):
        (inputs / f"hanging_{i}.obj").write_text("mtllib pipe.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    return inputs


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no pipes with names")
def test_a_killed_batch_leaves_no_children_on_the_workers(cluster, hanging, tmp_path, needs_bpy):
    out = tmp_path / "out"
    process = start("batch", "learn", hanging, "--output", out, *QUICK, "--no-thumbnails", "--scheduler", cluster[0])
    wait_for_lines(out, 1, process)
    assert wait_until(lambda: len(children()) == 2)
    process.kill()
    process.communicate()
    assert wait_until(lambda: not children()), "children are left"


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no pipes with names")
def test_a_scheduler_that_dies_is_the_reason(cluster, hanging, tmp_path, needs_bpy, monkeypatch):
    """Its files did not fail: a plain resume goes on there."""
    monkeypatch.setenv("DASK_DISTRIBUTED__COMM__TIMEOUTS__CONNECT", "3s")
    out = tmp_path / "out"
    batch = ("batch", "learn", hanging, "--output", out, *QUICK, "--no-thumbnails", "--json")
    process = start(*batch, "--scheduler", cluster[0])
    wait_for_lines(out, 1, process)
    cluster[2].kill()
    output, messages = process.communicate(timeout=100)
    assert process.returncode == 1, messages
    assert "the Dask scheduler does not answer any more" in json.loads(output)["error"]
    assert "--resume" in json.loads(output)["error"]
    assert "Traceback" not in messages
    assert [line["name"] for line in lines(out)] == ["a"]


def test_a_scheduler_that_does_not_answer_is_named(batch, monkeypatch):
    monkeypatch.setattr("wks_segment.batch.dask_cluster.CONNECT_SECONDS", 1)
    with pytest.raises(BatchError, match=r"tcp://127\.0\.0\.1:9: no Dask scheduler answers"):
        batch({"a": "one"}, scheduler="tcp://127.0.0.1:9").run(Progress())
    assert batch({"a": "one"}).run(Progress())["done"] == 1


def test_without_dask_the_message_says_what_to_install(batch, monkeypatch):
    monkeypatch.setattr("wks_segment.batch.batch_run.find_spec", lambda name: None)
    with pytest.raises(BatchError, match=r"--scheduler needs Dask.*pip install"):
        batch({"a": "one"}, scheduler="tcp://127.0.0.1:9").run(Progress())


def test_a_file_on_which_several_workers_died_is_given_up(batch):
    from wks_segment.batch.dask_cluster import _lost

    (job,) = batch({"a": "one"}).jobs
    worker = type("State", (), {"address": "tcp://somewhere"})()
    outcome = _lost(job, distributed.KilledWorker(job.key, worker, 3))
    assert not outcome.done
    assert "each worker that started it died" in outcome.reason
