"""Seconds of a processor that enabling the extension takes: `python -m benchmarks.enabling`.

Each try is a Blender of its own, in which NumPy is loaded already, and all but the first find the modules compiled. The
least of all tries counts: other programs only make it longer.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile

TRIES = 7
SCRIPT = """
import os, time
import bpy, numpy, numpy.typing
begun = time.process_time()
import wks_segment.blender
wks_segment.blender.register()
print(time.process_time() - begun, flush=True)
os._exit(0)  # some versions of bpy crash or hang at a normal exit
"""
FLOOR = 0.1
"""Seconds that it should stay below."""


def main() -> None:
    """Print the seconds of all tries; exit with 1 if all are too long."""
    with tempfile.TemporaryDirectory() as byte_code:
        tries = [seconds(byte_code) for _ in range(TRIES)]
    print(f"{min(tries):.3f} s at least, {max(tries):.3f} s at most, of {TRIES} tries; the floor is {FLOOR} s")
    sys.exit(min(tries) > FLOOR)


def seconds(byte_code: str) -> float:
    """Seconds of one try, which keeps compiled modules in a folder, as an installed extension does."""
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    environment["PYTHONPYCACHEPREFIX"] = byte_code
    command = [sys.executable, "-c", SCRIPT]
    done = subprocess.run(command, check=True, capture_output=True, text=True, env=environment)
    return float(done.stdout.splitlines()[-1])


if __name__ == "__main__":
    main()
