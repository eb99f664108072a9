"""`python -m wks_segment`: the command line in Python with the bpy module, without the Blender program."""

from __future__ import annotations

import json
import os
import signal
import sys
import traceback
from collections.abc import Iterator
from contextlib import contextmanager, suppress


def main() -> None:
    """Run the command line and end the process with its exit code."""
    try:
        with _ended_by_ctrl_c():
            import bpy  # noqa: F401

            from . import blender
            from .blender.cli.main import run

            blender.register()
        code = run(sys.argv[1:])
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


@contextmanager
def _ended_by_ctrl_c() -> Iterator[None]:
    """Have Ctrl+C end the process at once: an exception would leave a half-loaded Blender, which crashes later."""
    handler = signal.getsignal(signal.SIGINT)
    if handler != signal.SIG_IGN:
        signal.signal(signal.SIGINT, _end)
    yield
    if handler != signal.SIG_IGN:
        signal.signal(signal.SIGINT, handler)


def _end(number: int, frame: object) -> None:
    """End the process; writes without the buffers of Python, which may be in use."""
    os.write(2, b"wks_segment: interrupted\n")
    if "--json" in sys.argv:
        os.write(1, b'{"error": "interrupted"}\n')
    _remove_temporary_folder()
    os._exit(130)  # `cli.main.INTERRUPTED`, which is not loaded yet


def _remove_temporary_folder() -> None:
    """Remove Blender's folder for temporary files, which it makes when it is loaded, if it is empty."""
    folder = getattr(getattr(sys.modules.get("bpy"), "app", None), "tempdir", "")
    with suppress(OSError):
        os.rmdir(folder)


def _failed_to_start(error: BaseException) -> int:
    """Tell why the command line could not be started, as all commands tell their errors; the exit code."""
    if isinstance(error, ImportError):
        reason = _why_not_loaded(error)
    else:
        traceback.print_exc()
        reason = f"unexpected error, please report it: {type(error).__name__}: {error}"
    print(f"wks_segment: {reason}", file=sys.stderr)
    if "--json" in sys.argv:
        print(json.dumps({"error": reason}))
    return 1


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
