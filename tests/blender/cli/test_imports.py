"""What the command line and the extension import, and not before they need it."""

import re
import subprocess
import sys
from collections import Counter
from pathlib import Path

import pytest
from command_files import QUICK

ROOT = Path(__file__).resolve().parents[3]
LATE = ("sklearn", "joblib", "scipy.stats", "scipy.optimize", "scipy.cluster", "scipy.ndimage", "distributed", "dask")
"""Packages that take long to import, and that nothing needs at the start."""
MOST = {"scipy": 250, "numpy": 135}
"""Most modules of packages that are imported at the start: a fifth more than were when this was written."""
FOR_JOBS = ("scipy", "sklearn", "joblib", "threadpoolctl", "psutil", "wks_segment.batch", "wks_segment.blender.cli")
"""What nothing needs until a job starts or a command is called."""
ENABLED = """
import os, bpy, numpy
import wks_segment.blender as extension
extension.register()
os._exit(0)
"""
"""Python code that enables the extension, as Blender does it at its start."""


def imported(*arguments):
    """Names of the modules that Python imports with these arguments, and its standard output."""
    done = subprocess.run(
        [sys.executable, "-X", "importtime", *map(str, arguments)], cwd=ROOT, capture_output=True, text=True,
        timeout=120,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-1000:]
    return set(re.findall(r"^import time:.*\| +([\w.]+)$", done.stderr, re.MULTILINE)), done.stdout


def output_of(*arguments):
    """What Python prints with these arguments, without the cost of `-X importtime`."""
    done = subprocess.run([sys.executable, *arguments], cwd=ROOT, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr[-1000:]
    return done.stdout


def packages_among(modules, packages):
    return {name for name in packages if any(each == name or each.startswith(f"{name}.") for each in modules)}


@pytest.mark.parametrize(
    "arguments",
    [("-m", "wks_segment", "--version"), ("-m", "wks_segment", "--help"), ("-m", "wks_segment", "segment", "--help")],
    ids=["version", "help", "help of a command"],
)  # fmt: skip
def test_the_start_imports_only_what_it_needs(arguments):
    modules, _ = imported(*arguments)
    assert not packages_among(modules, LATE)
    counts = Counter(name.partition(".")[0] for name in modules)
    assert {name: counts[name] for name in MOST if counts[name] > MOST[name]} == {}


def test_enabling_the_extension_imports_nothing_that_jobs_need():
    modules, _ = imported("-c", ENABLED)
    assert "wks_segment.blender.operators.learn" in modules, "otherwise this test sees nothing"
    assert not packages_among(modules, FOR_JOBS)


NAMES = """
import sys, wks_segment.core as core
assert "scipy" not in sys.modules
assert sorted(sum(core.MODULES.values(), ())) == sorted(core.__all__)
assert set(core.__all__) <= set(dir(core))
for name in core.__all__:
    getattr(core, name)
assert "scipy" in sys.modules
"""


def test_public_names_are_imported_when_they_are_used():
    assert output_of("-c", NAMES) == ""


def test_version():
    assert re.fullmatch(r"wks_segment \d+\.\d+\.\d+\n", imported("-m", "wks_segment", "--version")[1])


def test_nothing_but_the_paper_setting_needs_scikit_learn(folder, tmp_path):
    model, labeled = tmp_path / "model.json", tmp_path / "labeled.obj"
    learned, _ = imported("-m", "wks_segment", "learn", folder / "pose_0.obj", *QUICK, "--model", model)
    applied, _ = imported(
        "-m", "wks_segment", "apply", folder / "pose_1.obj", "--model", model, "--output", labeled
    )  # fmt: skip
    for modules in (learned, applied):
        assert not packages_among(modules, ("sklearn", "joblib", "scipy.stats"))
    paper, _ = imported(
        "-m", "wks_segment", "learn", folder / "pose_0.obj", *QUICK, "--preset", "paper", "--model", model
    )  # fmt: skip
    assert packages_among(paper, ("sklearn",)), "otherwise this test sees nothing"
