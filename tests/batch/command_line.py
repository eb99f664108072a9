"""Helpers of batch tests: the command line in its own process, files of small characters, and the log of a batch."""

import json
import os
import subprocess
import sys
import time
from pathlib import Path

from shapes import creature

ROOT = Path(__file__).resolve().parents[2]
QUICK = ("--eigenpairs", "30", "--energies", "20", "--segments", "4")


def write(path, bend):
    mesh = creature(bend, 3)
    text = [f"v {x} {y} {z}" for x, y, z in mesh.vertices] + [f"f {a} {b} {c}" for a, b, c in mesh.faces + 1]
    path.write_text("\n".join(text) + "\n")
    return path


def start(*arguments):
    # One thread, as children have: sums over several threads differ in their last digits.
    environment = os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "PYTHONPATH": str(ROOT)}
    return subprocess.Popen(
        [sys.executable, "-m", "wks_segment", *map(str, arguments)], cwd=ROOT, env=environment, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )  # fmt: skip


def run(*arguments):
    process = start(*arguments)
    output, messages = process.communicate(timeout=120)
    return process.returncode, output, messages


def lines(folder):
    path = folder / "batch.jsonl"
    # The last line may be incomplete.
    return [json.loads(line) for line in path.read_text().split("\n")[:-1]] if path.exists() else []


def wait_for_lines(folder, count, process):
    deadline = time.monotonic() + 60
    while len(lines(folder)) < count and process.poll() is None and time.monotonic() < deadline:
        time.sleep(0.02)
