"""The command line in a process of its own: exit codes, output and interruption."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from builders import Outcome
from command_files import QUICK

ROOT = Path(__file__).resolve().parents[3]


def process(*arguments, **options):
    return subprocess.Popen(
        [sys.executable, "-m", "wks_segment", *map(str, arguments)],
        cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, **options,
    )  # fmt: skip


def ended(process):
    """Exit code and output of a process, which must end by itself."""
    try:
        out, err = process.communicate(timeout=120)
    finally:
        process.kill()
    return Outcome(process.returncode, out, err)


def test_process_prints_one_json_object_and_ends_with_0(folder, tmp_path):
    output = tmp_path / "out.glb"
    done = ended(process("segment", folder / "walker.glb", "--frames", 2, *QUICK, "--output", output, "--json"))
    assert done.code == 0, done
    assert len(done.result["poses"]) == 2
    assert output.stat().st_size > 10_000


def test_process_that_fails_ends_with_1(tmp_path):
    """With 2 after wrong usage: test_recipes.py, and test_command_failures.py within one process."""
    done = ended(process("segment", tmp_path / "missing.glb", "--json"))
    assert (done.code, list(done.result)) == (1, ["error"])


@pytest.mark.skipif(os.name == "nt", reason="Windows has no SIGINT to send to another process")
def test_interrupted_process_ends_at_once_without_a_crash(folder):
    # Processes that a shell starts in the background ignore the signal, and so may these tests and their processes.
    heed_signal = {"preexec_fn": lambda: signal.signal(signal.SIGINT, signal.SIG_DFL)}
    running = process("segment", folder / "walker.blend", "--frames", 20, **heed_signal)
    for line in running.stderr:
        if "Signature" in line:
            break
    running.send_signal(signal.SIGINT)
    done = ended(running)
    assert done.code in (1, 128 + signal.SIGINT, -signal.SIGINT), done
