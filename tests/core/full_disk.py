"""Full disks for tests: a limit on the size of files, and small file systems in memory."""

import contextlib
import os
import subprocess
import sys

import pytest


@contextlib.contextmanager
def files_end_at(n_bytes):
    """Have the system refuse what this process writes beyond so many bytes of a file, as a full disk would."""
    resource = pytest.importorskip("resource")  # not on Windows
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    with nothing_printed():  # to files, which would end there as well: Blender aborts then
        resource.setrlimit(resource.RLIMIT_FSIZE, (n_bytes, hard))
        try:
            yield
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


@contextlib.contextmanager
def nothing_printed():
    sys.stdout.flush()
    sys.stderr.flush()
    kept, nowhere = {stream: os.dup(stream) for stream in (1, 2)}, os.open(os.devnull, os.O_WRONLY)
    try:
        for stream in kept:
            os.dup2(nowhere, stream)
        yield
    finally:
        for stream, descriptor in kept.items():
            os.dup2(descriptor, stream)
            os.close(descriptor)
        os.close(nowhere)


@pytest.fixture
def small_disk(tmp_path):
    """A function that makes a folder of its own file system with so many kilobytes."""
    made = []

    def make(kilobytes):
        folder = tmp_path / f"disk_{len(made)}"
        folder.mkdir()
        mount = ["mount", "-t", "tmpfs", "-o", f"size={kilobytes}k", "tmpfs", str(folder)]
        if sys.platform != "linux" or subprocess.run(mount, capture_output=True, check=False).returncode:
            pytest.skip("a file system can be mounted by root on Linux only")
        made.append(folder)
        return folder

    yield make
    for folder in made:
        subprocess.run(["umount", "-l", str(folder)], check=True)
