"""Batches of many small files with kills: `python -m benchmarks.small_batches [--files 2000] [--kills 40] [--dask]`.

Writes creatures of 162 vertices as files, applies a model to them without a disturbance, and again while children (and
with `--dask` workers) and the batch itself are killed at random, resumed each time. Prints the throughput, the memory
of the children, the kills, and what differs in the end: every result must have the same bytes, every file one line in
the list, and no child may be left. Needs Linux or macOS.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import shutil
import subprocess
import sys
import time
import uuid
from collections import Counter
from contextlib import suppress
from pathlib import Path
from typing import Any

import psutil

from benchmarks.batches import cluster
from benchmarks.shapes import body

SETTINGS = ("--eigenpairs", "30", "--energies", "20", "--segments", "4")
N_VERTICES = 162
CHILD = "batch-child"
"""Argument of the processes of children."""
MARK = "WKS_SEGMENT_BENCHMARK"
"""Variable of the environment that children inherit from this benchmark, which kills no others."""
LONGEST_PAUSE = 6.0
"""Most seconds from one kill to the next: a child starts in two."""
RETRIES = 20
"""Most times that a batch is resumed after the last kill, for files whose child was killed at its first file."""


def main() -> None:
    """Run both batches and compare them."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--files", type=int, default=2000)
    parser.add_argument("--kills", type=int, default=40)
    parser.add_argument("--dask", action="store_true", help="kill a batch on two Dask workers, and the workers")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--output", type=Path, default=Path("demo/small_batches"))
    options = parser.parse_args()
    os.environ[MARK] = uuid.uuid4().hex
    shutil.rmtree(options.output, ignore_errors=True)
    inputs = options.output / "in"
    inputs.mkdir(parents=True)
    for i in range(options.files):
        write_creature(inputs / f"{i:04d}.obj", i / options.files)
    model = options.output / "model.json"
    command = [sys.executable, "-m", "wks_segment", "learn", str(inputs / "0000.obj"), "--model", str(model), *SETTINGS]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    whole, killed = options.output / "whole", options.output / "killed"
    undisturbed(inputs, model, whole)
    turn = random.Random(options.seed)
    if options.dask:
        with cluster() as (address, workers):
            disturbed(inputs, model, killed, options.kills, turn, address, workers)
    else:
        disturbed(inputs, model, killed, options.kills, turn)
    compare(whole, killed, options.files)


def write_creature(path: Path, bend: float) -> None:
    """Write a creature whose limbs are bent."""
    mesh = body(N_VERTICES, bend)
    lines = [f"v {x} {y} {z}" for x, y, z in mesh.vertices] + [f"f {a} {b} {c}" for a, b, c in mesh.faces + 1]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def undisturbed(inputs: Path, model: Path, out: Path) -> None:
    """Run a batch, and print its throughput and the memory of its children."""
    begun = time.monotonic()
    process = batch(inputs, model, out)
    memory: dict[int, list[int]] = {}
    while process.poll() is None:
        for child in children():
            memory.setdefault(child.pid, []).append(resident(child))
        time.sleep(0.5)
    seconds, count = time.monotonic() - begun, len(logged(out))
    print(f"{count} files in {seconds:.0f} s: {60 * count / seconds / 2:.0f} a minute and process")
    grown = [(samples[len(samples) // 3], samples[-1]) for samples in memory.values() if len(samples) > 20]
    for i, (early, late) in enumerate(grown):
        print(
            f"memory of child {i + 1}: {early / 1e6:.0f} MB after a third of its files, {late / 1e6:.0f} MB at the end"
        )


def disturbed(
    inputs: Path, model: Path, out: Path, kills: int, turn: random.Random, address: str = "",
    workers: list[subprocess.Popen[str]] | None = None,
) -> None:  # fmt: skip
    """Run a batch, kill at random, resume, until all is done; print what was killed."""
    killed: Counter[str] = Counter()
    scheduler = ["--scheduler", address] if address else []
    process = batch(inputs, model, out, *scheduler)
    ended_early = 0
    while sum(killed.values()) < kills and process.poll() != 0:
        time.sleep(turn.uniform(0.5, LONGEST_PAUSE))
        if process.poll():  # with a reason, or with failed files
            ended_early += 1
            process = batch(inputs, model, out, "--resume", "--retry", *scheduler)
            continue
        victim = turn.choice(["child", "child", "batch", *(["worker"] if workers else [])])
        if victim == "batch":
            process.kill()
            process.wait()
            killed[victim] += 1
            process = batch(inputs, model, out, "--resume", *scheduler)
        elif victim == "worker" and workers and len(workers) > 1:
            workers.pop().kill()
            killed[victim] += 1
        elif found := children():
            turn.choice(found).kill()
            killed["child"] += 1
    process.wait()
    rounds = 0
    while rounds < RETRIES and (rounds == 0 or process.returncode):
        process = batch(inputs, model, out, "--resume", "--retry", *scheduler)
        process.wait()
        rounds += 1
    counts = ", ".join(f"{name} {count} times" for name, count in sorted(killed.items()))
    print(f"killed: {counts}; resumed {killed['batch'] + ended_early + rounds} times, {rounds} of them at the end")


def compare(whole: Path, killed: Path, n_files: int) -> None:
    """Print what differs between two batches."""
    first, second = (sorted(path.name for path in folder.glob("*.obj")) for folder in (whole, killed))
    different = [name for name in first if name in second and not same(whole / name, killed / name)]
    lines = logged(killed)
    done = {line["input"] for line in lines if line["status"] == "done"}
    left = {path.name for path in killed.iterdir()} - {path.name for path in whole.iterdir()}
    time.sleep(2.0)
    print(f"files {n_files}, results {len(first)} and {len(second)}, with other bytes {len(different)}")
    print(
        f"lines of the list {len(lines)}, done {len(done)}; other files {sorted(left)}; children left {len(children())}"
    )


def batch(inputs: Path, model: Path, out: Path, *arguments: str) -> subprocess.Popen[bytes]:
    """Start a batch with two processes."""
    command = [sys.executable, "-m", "wks_segment", "batch", "apply", str(inputs), "--model", str(model), "--output"]
    command += [str(out), "--format", "obj", "--no-thumbnails", "--processes", "2", *arguments]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def children() -> list[psutil.Process]:
    """The children of the batches that this benchmark has started, also those that have lost their parent."""
    found = []
    for each in psutil.process_iter(["cmdline"]):
        with suppress(psutil.Error):
            if CHILD in (each.info["cmdline"] or ()) and each.environ().get(MARK) == os.environ[MARK]:
                found.append(each)
    return found


def resident(process: psutil.Process) -> int:
    """Bytes of resident memory; 0 if the process has ended."""
    try:
        return int(process.memory_info().rss)
    except psutil.Error:
        return 0


def logged(out: Path) -> list[dict[str, Any]]:
    """Lines of the list of a batch."""
    return [json.loads(line) for line in (out / "batch.jsonl").read_text(encoding="utf-8").splitlines()]


def same(one: Path, other: Path) -> bool:
    """Whether two files have the same bytes."""
    return one.read_bytes() == other.read_bytes()


if __name__ == "__main__":
    main()
    sys.stdout.flush()
    os._exit(0)
