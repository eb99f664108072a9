"""What the tests of batches share. Blender runs in child processes only, so that these tests run beside any bpy."""

import ctypes.util
import importlib.util
import sys
from pathlib import Path

import pytest

from wks_segment.batch import Batch, Job, Limits, Program, key_of

HERE = Path(__file__).parent
FAKE = Program((sys.executable, str(HERE / "fake_child.py")))
"""Starts a child that does as its files say, see there."""


def pytest_collection_modifyitems(items):
    if importlib.util.find_spec("bpy") is None:
        for item in items:
            if "needs_bpy" in item.fixturenames:
                item.add_marker(pytest.mark.skip(reason="bpy is not installed"))


@pytest.fixture
def needs_bpy():
    """Marks what starts real children."""


@pytest.fixture
def needs_rendering():
    """Skips where Blender cannot draw without a window."""
    if sys.platform == "linux" and not ctypes.util.find_library("EGL"):
        pytest.skip("Blender draws without a window through EGL, which is not installed (libegl1, libgl1-mesa-dri)")


@pytest.fixture
def batch(tmp_path):
    """A function that makes a batch of files with these texts, for fake children."""

    def make(texts, settings=(), outputs=None, **changes):
        jobs = []
        for name, text in texts.items():
            path = tmp_path / "in" / name
            path.parent.mkdir(exist_ok=True)
            if not path.exists() or path.read_text() != text:
                path.write_text(text)
            named = outputs or {"--out": "{}.txt"}
            key = key_of(path, settings)
            files = {option: pattern.format(name) for option, pattern in named.items()}
            jobs.append(Job(str(path), name, "copy", tuple(settings), files, key))
        values = {"folder": tmp_path / "out", "program": FAKE, "processes": 2, "limits": Limits(20.0)}
        return Batch(jobs=jobs, **(values | changes))

    return make
