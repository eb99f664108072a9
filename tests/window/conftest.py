"""The window tests run only when they are asked for: `make test-window`. See README.md."""

import os
import re
import shutil
from pathlib import Path

import pytest
from driver import HERE, SUITES, RealBlender, build_zip

ROOT = HERE.parents[1]
FOLDER = os.environ.get("WKS_SEGMENT_WINDOW")
"""Where the Blenders are, or get installed."""
PICTURES = ROOT / "window" / "screenshots"


def pytest_addoption(parser):
    parser.addoption("--blender", action="append", choices=SUITES, help="the window tests: with this one only")


def pytest_generate_tests(metafunc):
    if "blender" in metafunc.fixturenames:
        # Where the folder was not named on the command line, neither is its option.
        versions = metafunc.config.getoption("blender", default=None) or list(SUITES)
        metafunc.parametrize("blender", versions, indirect=True, scope="session")


@pytest.fixture(scope="session")
def extension_zip(tmp_path_factory):
    return build_zip(tmp_path_factory.mktemp("dist"))


@pytest.fixture(scope="session")
def blender(request):
    """A real Blender with the extension, and a creature to work on."""
    if FOLDER is None:
        pytest.skip("needs root, a Debian mirror and 2 GB for a real Blender: make test-window")
    with RealBlender(request.param, Path(FOLDER)) as blender:
        blender.install_extension(request.getfixturevalue("extension_zip"))
        blender.make_scene("creature", UNTOUCHED)
        yield blender


UNTOUCHED, SCENE = "untouched.blend", "creature.blend"
"""The scene as it was made, and the one that a test opens, and may save."""


@pytest.fixture
def window(blender):
    """Blender's window with the creature before it."""
    blender.clicks = 0
    shutil.copyfile(blender.shared / UNTOUCHED, blender.shared / SCENE)
    blender.start(f"/window/{SCENE}")
    blender.ask("zoom_to_all")
    yield blender
    blender.stop()


@pytest.fixture
def shot(blender, request):
    """A function that keeps a picture of the window, numbered in the order of the steps."""
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
    """No test leaves a warning or an error on the terminal."""
    yield
    if "window" in request.fixturenames:
        assert complaints(request.getfixturevalue("blender").log()) == []


EXPECTED = ("list of mounted file-systems",)
"""What Blender says in a chroot whatever happens."""


def complaints(log):
    """Lines that tell of something wrong."""
    signs = ("warning", "error", "traceback", "exception", "not found", "unknown")
    return [
        line for line in log.splitlines() if any(sign in line.lower() for sign in signs)
        and not any(known in line for known in EXPECTED)
    ]  # fmt: skip
