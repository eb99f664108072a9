"""`python -m wks_segment`: the command line in Python with the bpy module, without the Blender program."""

from __future__ import annotations

import json
import os
import signal
import sys
import traceback
from contextlib import suppress
from types import FrameType
from typing import NoReturn

from .interruption import Interrupted, handled


def main() -> None:
    """Run the command line and end the process with its exit code."""
    try:
        with handled(_end_at_once):  # a command that runs is ended in its own way
            import bpy  # noqa: F401

            from . import blender
            from .blender.cli.main import run

            blender.register()
            code = run(sys.argv[1:])
        with handled(signal.SIG_IGN):  # the command has ended
            blender.unregister()
    except SystemExit as end:  # argparse, after the help
        code = int(end.code or 0)
    except BaseException as error:
        code = _failed_to_start(error)
    sys.stdout.flush()
    sys.stderr.flush()
    _remove_temporary_folder()
    # Some versions of bpy crash or hang at a normal exit.
    os._exit(code)


def _failed_to_start(error: BaseException) -> int:
    """Tell why the command line could not be started, as all commands tell their errors; the exit code."""
    if isinstance(error, ImportError):
        reason = _why_not_loaded(error)
    else:
        traceback.print_exc()
        reason = f"unexpected error, please report it: {type(error).__name__}: {error}"
    _tell(reason)
    return 1


def _end_at_once(number: int, frame: FrameType | None) -> NoReturn:
    """End the process: an error could be caught by Blender's own start, or leave a half-loaded Blender that crashes."""
    with handled(signal.SIG_IGN):  # a second signal would be told again
        interruption = Interrupted(number)
        _tell(str(interruption))
        _remove_temporary_folder()
        os._exit(interruption.code)


def _tell(reason: str) -> None:
    """Print a reason without the buffers of Python, which may be in use when a signal arrives."""
    with suppress(OSError):
        os.write(2, f"wks_segment: {reason}\n".encode(errors="backslashreplace"))
        if "--json" in sys.argv:
            os.write(1, f"{json.dumps({'error': reason})}\n".encode())


def _remove_temporary_folder() -> None:
    """Remove Blender's folder for temporary files, which it makes when it is loaded, if it is empty."""
    folder = getattr(getattr(sys.modules.get("bpy"), "app", None), "tempdir", "")
    with suppress(OSError):
        os.rmdir(folder)


def _why_not_loaded(error: ImportError) -> str:
    """What is missing, a package of Python or a library of the system, and what to do."""
    if not isinstance(error, ModuleNotFoundError):  # the package is there, but not what it needs
        return f"a library is missing or does not fit: {error}: install it with the package manager of the system"
    if error.name == "bpy":
        return (
            "this command needs Blender as a Python module (pip install bpy); or use Blender: "
            "blender --command wks_segment"
        )
    package = str(error.name).partition(".")[0]
    return f'the Python package "{package}" is missing in {sys.executable}: pip install wks-segment'


if __name__ == "__main__":
    main()
