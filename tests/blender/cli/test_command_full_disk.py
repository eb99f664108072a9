"""A command whose disk is full: a reason, an exit code, and what was there before."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from command_files import QUICK, assert_fails

from wks_segment.blender.cli import main

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture
def full(small_disk):
    """A folder with 4 kB of free space."""
    disk = small_disk(64)
    (disk / "filler").write_bytes(bytes(2**16 - 4096))
    return disk


@pytest.fixture
def model(command, folder, tmp_path):
    assert command("learn", folder / "pose_0.obj", *QUICK, "--model", tmp_path / "model.json").code == 0
    return tmp_path / "model.json"


@pytest.mark.parametrize("name", ["out.blend", "out.glb", "out.obj", "out.png", "out.json"])
def test_a_full_disk_is_a_failure_and_keeps_the_older_file(command, folder, model, full, name, request):
    if name.endswith("png"):
        request.getfixturevalue("needs_rendering")
    (full / name).write_text("older")
    if name.endswith("json"):
        done = command("learn", folder / "pose_0.obj", *QUICK, "--model", full / name, "--json")
    else:
        option = "--render" if name.endswith("png") else "--output"
        done = command("apply", folder / "pose_0.obj", "--model", model, option, full / name, "--json")
    assert_fails(done, name, "No space left on device")
    assert list(done.result) == ["error"]
    assert (full / name).read_text() == "older"
    assert sorted(path.name for path in full.iterdir()) == sorted(["filler", name])


def test_a_full_disk_ends_a_batch(command, folder, model, small_disk):
    disk = small_disk(200)
    batch = ("batch", "apply", folder / "pose_*.obj", "--model", model, "--output", disk / "out", "--no-thumbnails",
             "--processes", 1, "--json")  # fmt: skip
    done = command(*batch)
    assert_fails(done, "No space left on device", "make room on the disk", "--resume")
    finished = len(list((disk / "out").glob("*.blend")))
    assert finished < 3
    subprocess.run(["mount", "-o", "remount,size=4M", disk], check=True)
    done = command(*batch, "--resume")
    assert (done.code, done.result["done"], done.result["now"]) == (0, 3, 3 - finished)


def test_the_reason_of_a_full_disk_ends_the_batch(folder, model, full):
    """What a child of a batch answers."""
    given = ("apply", folder / "pose_0.obj", "--model", model, "--output", full / "out.blend")
    answer = main.answer([str(argument) for argument in given])
    assert (answer.result, answer.disk_full) == (None, True)


def test_a_standard_output_that_is_full(folder, tmp_path):
    if not Path("/dev/full").exists():
        pytest.skip("Linux has /dev/full")
    with open("/dev/full", "w") as nowhere:
        done = subprocess.run(
            [sys.executable, "-m", "wks_segment", "learn", folder / "pose_0.obj", *map(str, QUICK), "--model",
             tmp_path / "model.json", "--json"], cwd=ROOT, stdout=nowhere, stderr=subprocess.PIPE, text=True,
        )  # fmt: skip
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1] == "wks_segment: the result cannot be printed: No space left on device"
    assert "Traceback" not in done.stderr


def test_a_current_folder_that_is_gone(command, folder, tmp_path, monkeypatch):
    gone = tmp_path / "gone"
    gone.mkdir()
    monkeypatch.chdir(gone)
    gone.rmdir()
    try:
        done = command("learn", folder / "pose_0.obj", *QUICK, "--model", "model.json", "--json")
        assert_fails(done, "No such file or directory")
    finally:
        os.chdir(ROOT)


def test_a_folder_that_is_deleted_while_the_command_runs(command, folder, tmp_path, monkeypatch):
    (tmp_path / "out").mkdir()
    learn = main.segment.pipeline.learn
    monkeypatch.setattr(main.segment.pipeline, "learn", lambda *rest: (learn(*rest), (tmp_path / "out").rmdir())[0])
    done = command("learn", folder / "pose_0.obj", *QUICK, "--model", tmp_path / "out" / "model.json", "--json")
    assert_fails(done, "model.json", "No such file or directory")


def test_a_link_to_nowhere(command, folder, tmp_path):
    (tmp_path / "link.json").symlink_to(tmp_path / "nowhere" / "model.json")
    done = command("learn", folder / "pose_0.obj", *QUICK, "--model", tmp_path / "link.json", "--json")
    assert_fails(done, "link.json", "nowhere does not exist")
    (tmp_path / "nowhere").mkdir()
    assert command("learn", folder / "pose_0.obj", *QUICK, "--model", tmp_path / "link.json").code == 0
    assert (tmp_path / "link.json").is_symlink()
