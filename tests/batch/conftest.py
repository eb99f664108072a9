"""Fixtures of the batch tests. Blender runs in child processes only, so these tests do not need a bpy of their own."""

import ctypes.util
import importlib.util
import sys
from pathlib import Path

import pytest

from wks_segment.batch import Batch, Job, Limits, Program, job_key

HERE = Path(__file__).parent
FAKE = Program((sys.executable, str(HERE / "fake_child.py")))
"""Starts a fake child, which does what its input files say."""


def pytest_collection_modifyitems(items):
    if importlib.util.find_spec("bpy") is None:
        for item in items:
            if "needs_bpy" in item.fixturenames:
                item.add_marker(pytest.mark.skip(reason="bpy is not installed"))


@pytest.fixture
def needs_bpy():
    """Mark a test that starts real children."""


@pytest.fixture
def needs_rendering():
    """Skip a test where Blender cannot render without a window."""
    if sys.platform == "linux" and not ctypes.util.find_library("EGL"):
        pytest.skip("Blender renders without a window through EGL, which is not installed (libegl1, libgl1-mesa-dri)")


@pytest.fixture
def batch(tmp_path):
    """A function that makes a batch of files with given texts, for fake children."""

    def make(texts, settings=(), outputs=None, **changes):
        jobs = []
        for name, text in texts.items():
            path = tmp_path / "in" / name
            path.parent.mkdir(exist_ok=True)
            if not path.exists() or path.read_text() != text:
                path.write_text(text)
            patterns = outputs or {"--out": "{}.txt"}
            key = job_key(path, settings)
            files = {option: pattern.format(name) for option, pattern in patterns.items()}
            jobs.append(Job(str(path), name, "copy", tuple(settings), files, key))
        values = {"folder": tmp_path / "out", "program": FAKE, "processes": 2, "limits": Limits(20.0)}
        return Batch(jobs=jobs, **(values | changes))

    return make
