"""What the tests of the Blender part share. Needs bpy; without it they are left out.

`builders` makes the characters, this file the surroundings: settings of their own, an empty scene, a way out.
"""

import contextlib
import ctypes
import ctypes.util
import importlib.util
import os
import shutil
import sys
import tempfile
from pathlib import Path

import pytest

# Before bpy is imported: neither the user's settings nor the user's extensions take part.
RESOURCES = tempfile.mkdtemp(prefix="wks_segment_tests_")
os.environ["BLENDER_USER_RESOURCES"] = RESOURCES
# And before OpenMP is loaded: its threads wait for each other in a loop, which makes small problems slow, not fast.
os.environ["OMP_NUM_THREADS"] = "1"
HAS_BPY = importlib.util.find_spec("bpy") is not None
if not HAS_BPY:
    HERE = Path(__file__).parent
    collect_ignore = [str(p.relative_to(HERE)) for p in HERE.rglob("test_*.py") if "zip" not in p.name]
LIBC = ctypes.cdll.msvcrt if os.name == "nt" else ctypes.CDLL(None)
STDOUT = open(1, "w", encoding="utf-8", closefd=False)  # noqa: SIM115  # importers keep it
"""Writes to descriptor 1, as sys.stdout of a real process does and pytest's does not."""
SESSION = pytest.StashKey[pytest.Session]()


def pytest_collection_finish(session):
    session.config.stash[SESSION] = session


@pytest.hookimpl(trylast=True)
def pytest_unconfigure(config):
    """End the process before Blender does: 4.2 crashes at a normal exit, 4.5 hangs."""
    shutil.rmtree(RESOURCES, ignore_errors=True)
    session = config.stash.get(SESSION, None)
    if session is not None and "bpy" in sys.modules:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(int(session.exitstatus))


@pytest.fixture(scope="session")
def extension(tmp_path_factory):
    """The package, registered as Blender does it when the extension is enabled."""
    import wks_segment.blender

    wks_segment.blender.register()
    yield wks_segment.blender
    wks_segment.blender.unregister()
    # pytest would do it as the process ends, but see pytest_unconfigure; later runs keep a locked folder for days.
    (tmp_path_factory.getbasetemp() / ".lock").unlink(missing_ok=True)


@pytest.fixture(scope="module", autouse=True)
def learned_once():
    """Models are learned once a process, where many tests learn the same."""
    if not HAS_BPY:
        yield None
        return
    from learned_once import LearnedOnce

    with LearnedOnce.shared() as once:
        yield once


@pytest.fixture(autouse=True)
def starter_folder(tmp_path_factory, monkeypatch):
    """An empty folder in the place of the one with the models that come with the extension."""
    if not HAS_BPY:
        return None
    from wks_segment.blender.workflow import model_library

    folder = tmp_path_factory.mktemp("starters")
    monkeypatch.setattr(model_library, "STARTER_FOLDER", folder)
    return folder


@pytest.fixture
def learns_anew(learned_once):
    """For a test of what happens while a model is learned."""
    learned_once.anew = True
    yield
    learned_once.anew = False


@pytest.fixture
def scene(extension):
    """An empty scene, with settings that make a computation take a tenth of a second."""
    import bpy

    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    from wks_segment.blender.workflow.live_session import session_of

    session_of(bpy.context).cache.clear()
    settings = bpy.context.scene.wks_segment
    settings.source = "OBJECTS"
    settings.n_segments, settings.n_eigenpairs, settings.n_energies = 4, 30, 40
    return bpy.context.scene


@pytest.fixture
def settings(scene):
    return scene.wks_segment


@pytest.fixture
def printed(capfd):
    """A function that gives what was printed since its last call, Blender's own lines among them."""

    def read():
        sys.stdout.flush()
        LIBC.fflush(None)
        return capfd.readouterr()

    return read


@pytest.fixture
def command(scene, extension, printed):
    """A function that runs the command line in this process."""
    from builders import Outcome

    from wks_segment.blender.cli.main import run as run_command

    def run(*arguments):
        printed()
        with contextlib.redirect_stdout(STDOUT):
            try:
                code = run_command([str(argument) for argument in arguments])
            except SystemExit as end:
                code = end.code
            STDOUT.flush()
        return Outcome(code, *printed())

    return run


@pytest.fixture
def needs_rendering():
    """Skips where Blender cannot draw without a window."""
    if sys.platform == "linux" and not ctypes.util.find_library("EGL"):
        pytest.skip("Blender draws without a window through EGL, which is not installed (libegl1, libgl1-mesa-dri)")
