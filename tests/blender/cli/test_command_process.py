"""The command line in a process of its own: exit codes, output and interruption."""

import os
import signal
import subprocess
import sys
import time
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


@pytest.mark.parametrize(
    "arguments",
    [("--help",), ("segment", "missing.glb"),
     ("learn", "{walker}", "--frames", "2", "--model", "{out}/model.json", *QUICK),
     ("batch", "learn", "{walker}", "--frames", "2", "--output", "{out}/models", *QUICK)],
    ids=lambda arguments: arguments[0],
)  # fmt: skip
def test_no_process_leaves_temporary_files(folder, tmp_path, arguments):
    for name in ("temporary", "out"):
        (tmp_path / name).mkdir()
    given = [str(each).format(walker=folder / "walker.blend", out=tmp_path / "out") for each in arguments]
    done = ended(process(*given, env=os.environ | {"TMPDIR": str(tmp_path / "temporary")}))
    assert done.code == (1 if "missing.glb" in arguments else 0), done
    assert not list((tmp_path / "temporary").iterdir())


needs_signals = pytest.mark.skipif(os.name == "nt", reason="Windows has no signals to send to another process")
# Processes that a shell starts in the background ignore Ctrl+C, and so may these tests and their processes.
HEEDS_SIGNALS = {} if os.name == "nt" else {"preexec_fn": lambda: signal.signal(signal.SIGINT, signal.SIG_DFL)}
ENDS = {signal.SIGINT: "interrupted", signal.SIGTERM: "ended from outside"}


def check_interrupted(done, number):
    assert done.code == 128 + number, done
    assert list(done.result) == ["error"]
    assert done.result["error"].startswith(ENDS[number])
    assert "Traceback" not in done.err


@needs_signals
@pytest.mark.parametrize("number", ENDS)
@pytest.mark.parametrize("seconds", [0.2, 0.6, 1.0, 1.5, 2.0])
def test_process_that_is_interrupted_while_blender_loads(tmp_path, seconds, number):
    running = process("segment", tmp_path / "missing.glb", "--json", **HEEDS_SIGNALS)
    time.sleep(seconds)
    running.send_signal(number)
    done = ended(running)
    if done.code == 1:  # it was faster
        assert done.result == {"error": f"{tmp_path / 'missing.glb'}: there is no such file"}
    elif done.code == -number:  # on a busy machine, Python was still starting
        assert "in main" not in done.err
    else:
        check_interrupted(done, number)


@needs_signals
@pytest.mark.parametrize("number", ENDS)
def test_interrupted_process_prints_one_json_object(folder, tmp_path, number):
    environment = os.environ | {"TMPDIR": str(tmp_path)}
    running = process("segment", folder / "walker.blend", "--frames", 20, "--json", env=environment, **HEEDS_SIGNALS)
    for line in running.stderr:
        if "Signature" in line:
            break
    running.send_signal(number)
    check_interrupted(ended(running), number)
    assert not list(tmp_path.iterdir())


@needs_signals
@pytest.mark.parametrize("number", ENDS)
def test_process_that_is_interrupted_while_blender_starts(folder, number):
    code = (
        "import os, sys, types, runpy; bpy = sys.modules['bpy'] = types.ModuleType('bpy'); "
        "bpy.__getattr__ = lambda name: os.kill(os.getpid(), {}); runpy.run_module('wks_segment', run_name='__main__')"
    )
    running = subprocess.Popen(
        [sys.executable, "-c", code.format(int(number)), "segment", "walker.blend", "--json"],
        cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, **HEEDS_SIGNALS,
    )  # fmt: skip
    check_interrupted(ended(running), number)


@needs_signals
@pytest.mark.parametrize("number", ENDS)
def test_interrupted_batch_prints_one_json_object(folder, tmp_path, number):
    running = process(
        "batch", "learn", folder, "--frames", 20, "--output", tmp_path / "out", "--json", **HEEDS_SIGNALS
    )  # fmt: skip
    for line in running.stderr:
        if "0 of" in line:
            break
    running.send_signal(number)
    done = ended(running)
    check_interrupted(done, number)
    assert "--resume" in done.result["error"]
