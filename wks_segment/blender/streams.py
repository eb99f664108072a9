"""Standard output and standard error as files of the process, where Blender's own code prints too."""

from __future__ import annotations

import ctypes
import os
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager

STREAMS = (1, 2)
"""File descriptors of standard output and standard error."""


def flush_streams() -> None:
    """Write what Python and the C library still keep in buffers."""
    for stream in (sys.stdout, sys.stderr):
        if stream is not None:
            stream.flush()
    ctypes.CDLL("ucrtbase" if sys.platform == "win32" else None).fflush(None)


@contextmanager
def silent(unless_it_fails: bool = False) -> Iterator[None]:
    """Drop all that is printed in the block.

    For code of Blender that tells what concerns nobody, as importers do, and graphics drivers without a screen.

    Parameters
    ----------
    unless_it_fails : bool
        Print it on standard error if the block raises an error.
    """
    flush_streams()
    # No file if nobody reads it: Blender ends the process if it cannot print, as on a full disk.
    with tempfile.TemporaryFile() if unless_it_fails else open(os.devnull, "r+b") as held:
        originals = {stream: os.dup(stream) for stream in STREAMS}
        for stream in STREAMS:
            os.dup2(held.fileno(), stream)
        failed = True
        try:
            yield
            failed = False
        finally:
            flush_streams()
            for stream, original in originals.items():
                os.dup2(original, stream)
                os.close(original)
            if failed and unless_it_fails:
                held.seek(0)
                sys.stderr.write(held.read().decode(errors="replace"))
