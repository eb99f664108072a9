"""The extension repository of `make repository` in a real Blender: install from an address, and update.

No window is opened. An update must keep the user's models, names, settings, preferences and presets.
"""

import functools
import os
import re
import shutil
import subprocess
import threading
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer

import pytest
from conftest import ROOT
from driver import HERE

from scripts import build_repository, build_zip

OLD, LAST_OF_OLD = "0.1.0", "cfd421d"
"""The version that is updated, and its last commit."""
NAME = "wks_repository"


class Quiet(SimpleHTTPRequestHandler):
    """A web server that prints nothing."""

    def log_message(self, *args):
        pass


@pytest.fixture
def new_user(blender):
    """Blender as a user starts it who has nothing of ours."""
    before = blender.user
    blender.user = "/window/new_user"
    shutil.rmtree(blender.shared / "new_user", ignore_errors=True)
    yield blender
    blender.user = before


@pytest.fixture
def served(tmp_path):
    """A folder, and the address at which a web server serves it."""
    folder = tmp_path / "public"
    folder.mkdir()
    server = ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Quiet, directory=str(folder)))
    thread = threading.Thread(target=server.serve_forever)
    thread.start()
    yield folder, f"http://127.0.0.1:{server.server_port}/"
    server.shutdown()
    thread.join()
    server.server_close()


@pytest.fixture(scope="session")
def old_zip(tmp_path_factory):
    """The extension as it was in version 0.1.0, or in a shallow clone today's with that number."""
    if "WKS_SEGMENT_WINDOW" not in os.environ:  # fixtures of the session come before those that skip
        pytest.skip("needs a real Blender")
    source = tmp_path_factory.mktemp("old")
    archive = subprocess.run(["git", "archive", LAST_OF_OLD], cwd=ROOT, capture_output=True, check=False)
    if archive.returncode == 0:
        subprocess.run(["tar", "-x", "-C", source], input=archive.stdout, check=True)
    else:
        ignored = shutil.ignore_patterns("__pycache__")
        shutil.copytree(ROOT / build_zip.PACKAGE, source / build_zip.PACKAGE, ignore=ignored)
        for name in ("__init__.py", "LICENSE", build_zip.README):
            shutil.copy2(ROOT / name, source / name)
        manifest = (ROOT / build_zip.MANIFEST).read_text(encoding="utf-8")
        (source / build_zip.MANIFEST).write_text(re.sub(r'\nversion = ".*"', f'\nversion = "{OLD}"', manifest))
    output = tmp_path_factory.mktemp("old_zip")
    arguments = ["--source", source, "--output", output, "--platform", "linux-x64", "--python", "3.13", "3.14"]
    assert build_zip.main(list(map(str, arguments))) == 0
    return next(output.glob("*.zip"))


def test_install_from_an_address_and_update(new_user, served, old_zip, extension_zip):
    blender, (folder, address) = new_user, served
    new_version = extension_zip.name.split("-")[1]
    assert new_version != OLD
    build_repository.make_repository([old_zip], folder)
    extensions(blender, "repo-add", "--name", "WKS Segment", "--url", f"{address}index.json", NAME)
    extensions(blender, "sync")
    assert "wks_segment" in extensions(blender, "list")
    extensions(blender, "install", "--enable", f"{NAME}.wks_segment")
    steps = blender.bring(HERE / "update_steps.py")
    run = functools.partial(blender.command, "--background", "--python-exit-code", "1", "--python", steps, "--")
    run("use", OLD)

    build_repository.make_repository([extension_zip], folder)
    extensions(blender, "sync")
    extensions(blender, "update")
    run("check", new_version)


def extensions(blender, *arguments):
    return blender.command("--online-mode", "--command", "extension", *arguments)
