"""Fixtures of the window tests, which run only by `make test-window`; see README.md."""

import os
import re
import shutil
from pathlib import Path

import pytest
from driver import HERE, SUITES, RealBlender, build_zip

ROOT = HERE.parents[1]
FOLDER = os.environ.get("WKS_SEGMENT_WINDOW")
"""Folder in which the Blenders are, or are installed."""
PICTURES = ROOT / "window" / "screenshots"


def pytest_addoption(parser):
    parser.addoption("--blender", action="append", choices=SUITES, help="run the window tests only with this Blender")


def pytest_generate_tests(metafunc):
    if "blender" in metafunc.fixturenames:
        # The option exists only if this folder is named on the command line.
        versions = metafunc.config.getoption("blender", default=None) or list(SUITES)
        metafunc.parametrize("blender", versions, indirect=True, scope="session")


@pytest.fixture(scope="session")
def extension_zip(tmp_path_factory):
    return build_zip(tmp_path_factory.mktemp("dist"))


@pytest.fixture(scope="session")
def blender(request):
    """A real Blender with the extension, and a file with the creature."""
    if FOLDER is None:
        pytest.skip("needs root, a Debian mirror and 2 GB for a real Blender: make test-window")
    with RealBlender(request.param, Path(FOLDER)) as blender:
        blender.install_extension(request.getfixturevalue("extension_zip"))
        blender.make_scene("creature", UNTOUCHED)
        yield blender


UNTOUCHED, SCENE = "untouched.blend", "creature.blend"
"""The scene as it was made, and the copy that a test opens and may save."""


@pytest.fixture
def window(blender):
    """Blender's window with the creature in view."""
    blender.clicks = 0
    shutil.copyfile(blender.shared / UNTOUCHED, blender.shared / SCENE)
    blender.start(f"/window/{SCENE}")
    blender.ask("zoom_to_all")
    yield blender
    blender.stop()


FROM_THE_FRONT = 15.0
"""Direction of the view around the vertical, in degrees."""


@pytest.fixture
def pair(blender):
    """The window with two creatures on the ground, under a lamp."""
    blender.clicks = 0
    blender.start(blender.make_scene("pair", "pair.blend"))
    blender.ask("zoom_to_all", FROM_THE_FRONT)  # so that both can be clicked
    yield blender
    blender.stop()


@pytest.fixture
def shot(blender, request):
    """A function that saves a screenshot of the window, numbered in the order of the steps."""
    test = request.node.name.removeprefix("test_").replace(blender.version, "")
    folder = PICTURES / blender.version / re.sub(r"\W+", "_", test).strip("_")
    taken = []
    for old in folder.glob("*.png"):
        old.unlink()

    def take(step):
        taken.append(step)
        blender.screenshot(folder / f"{len(taken):02} {step}.png")

    return take


@pytest.fixture(autouse=True)
def quiet(request):
    """Fail a test that leaves a warning or an error on the terminal."""
    yield
    if {"window", "pair", "opened"} & set(request.fixturenames):
        assert complaints(request.getfixturevalue("blender").log()) == []


EXPECTED_LINES = ("list of mounted file-systems", "You have changed these")
"""Lines that Blender always prints in a chroot, and warnings of ours that tests ask for."""


def complaints(log):
    """Lines of a log that report a problem."""
    signs = ("warning", "error", "traceback", "exception", "not found", "unknown")
    return [
        line for line in log.splitlines() if any(sign in line.lower() for sign in signs)
        and not any(known in line for known in EXPECTED_LINES)
    ]  # fmt: skip
