"""Every end of a command: one JSON object if that is asked for, an exit code, and a quiet standard error."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from command_files import QUICK

from wks_segment.blender.cli import main
from wks_segment.blender.workflow import pipeline
from wks_segment.interruption import Interrupted

ROOT = Path(__file__).resolve().parents[3]


def strict(text):
    """The object in JSON text, which must be that of the standard."""
    return json.loads(text, parse_constant=lambda name: pytest.fail(f"{name} is not JSON"))


def python(code, *arguments, **environment):
    """Run Python with a command line of ours in a process of its own; its exit code and output."""
    return subprocess.run(
        [sys.executable, *code, *map(str, arguments)], cwd=ROOT, capture_output=True, text=True, timeout=120,
        env=os.environ | environment,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("error", "code", "words"),
    [
        (ZeroDivisionError("nobody thought of it"), 1, "ZeroDivisionError: nobody thought of it"),
        (RuntimeError(""), 1, "RuntimeError"),
        (SystemExit(3), 1, "SystemExit"),
        (MemoryError(), 1, "not enough memory"),
        (PermissionError(13, "Permission denied", "/some/file"), 1, "/some/file: Permission denied"),
        (Interrupted(signal.SIGINT), 130, "interrupted"),
    ],
    ids=lambda value: type(value).__name__ if isinstance(value, BaseException) else "",
)
def test_error_that_nobody_foresaw(command, folder, monkeypatch, error, code, words):
    def fail(*_):
        raise error

    monkeypatch.setattr(pipeline, "learn", fail)
    done = command("segment", folder / "pose_0.obj", *QUICK, "--json")
    assert done.code == code
    assert list(done.result) == ["error"]
    assert words in done.result["error"]
    assert words in done.err.splitlines()[-1], "the reason comes last"
    assert ("Traceback" in done.err) == isinstance(error, ZeroDivisionError | RuntimeError | SystemExit)


@pytest.mark.parametrize(
    "arguments", [("segment",), ("segment", "{pose}", "--segments", "1"), ("frobnicate",), ("rank",)], ids=" ".join
)
def test_wrong_usage(command, folder, arguments):
    done = command(*(argument.format(pose=folder / "pose_0.obj") for argument in arguments), "--json")
    assert done.code == 2
    assert list(done.result) == ["error"]
    assert done.result["error"].startswith("wrong usage: ")


def test_numbers_that_json_does_not_have(command, folder, monkeypatch):
    monkeypatch.setattr(
        "wks_segment.blender.cli.commands.segment.result_of",
        lambda *_: {"score": float("-inf"), "poses": [{"share": float("nan")}], "path": Path("a")},
    )
    done = command("segment", folder / "pose_0.obj", *QUICK, "--json")
    assert strict(done.out) == {"score": None, "poses": [{"share": None}], "path": "a"}


def test_job_of_a_batch(folder, scene, monkeypatch):
    """The reason goes to the list of the batch."""
    assert main.answer(["segment"]).error == "wrong usage: the following arguments are required: FILE"
    assert "no such file" in main.answer(["segment", "missing.glb"]).error

    def fail(*_):
        raise PermissionError(13, "Permission denied", "/some/file")

    monkeypatch.setattr(pipeline, "learn", fail)
    assert (
        main.answer(["segment", str(folder / "pose_0.obj"), *map(str, QUICK)]).error == "/some/file: Permission denied"
    )


BLOCKED = "import sys, runpy; sys.modules['{}'] = None; runpy.run_module('wks_segment', run_name='__main__')"
"""Python code that runs the command line without a package."""


@pytest.mark.parametrize(("package", "words"), [("bpy", "pip install bpy"), ("scipy", '"scipy" is missing')])
def test_package_that_is_missing(package, words):
    done = python(["-c", BLOCKED.format(package)], "segment", "character.glb", "--json")
    assert done.returncode == 1
    assert words in strict(done.stdout)["error"]
    assert "Traceback" not in done.stderr


def test_library_of_the_system_that_is_missing(tmp_path):
    (tmp_path / "bpy.py").write_text("raise ImportError('libSM.so.6: cannot open shared object file')")
    path = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])
    done = python(["-m", "wks_segment"], "segment", "character.glb", "--json", PYTHONPATH=path)
    assert done.returncode == 1
    assert "a library is missing" in strict(done.stdout)["error"]
    assert "libSM.so.6" in done.stderr


@pytest.mark.usefixtures("needs_rendering")
@pytest.mark.parametrize("suffix", [".blend", ".glb", ".obj"])
def test_a_pipe_gets_one_line_for_each_stage(folder, tmp_path, suffix):
    picture, scene = tmp_path / "poses.png", tmp_path / f"scene{suffix}"
    done = python(
        ["-m", "wks_segment"], "segment", folder / "walker.glb", "--frames", 3, *QUICK, "--render", picture,
        "--output", scene,
    )  # fmt: skip
    assert (done.returncode, picture.is_file(), scene.is_file()) == (0, True, True)
    lines = done.stderr.splitlines()
    stages = [line.partition(" %  ")[2] for line in lines]
    assert all(stages), f"other lines than of stages:\n{done.stderr}"
    assert len(set(stages)) == len(stages)
    shares = [int(line.partition("%")[0]) for line in lines]
    assert shares == sorted(shares)
