"""`python -m wks_segment`: the command line in Python with the bpy module, without the Blender program."""

from __future__ import annotations

import os
import sys
import traceback


def main() -> None:
    """Run the command line and end the process with its exit code."""
    try:
        import bpy  # noqa: F401
    except ImportError:
        sys.exit(
            "wks_segment: this command needs Blender as a Python module (pip install bpy); or use Blender: "
            "blender --command wks_segment"
        )
    from . import blender
    from .blender.cli.main import run

    blender.register()
    try:
        code = run(sys.argv[1:])
    except SystemExit as end:  # argparse
        code = int(end.code or 0)
    except BaseException:
        traceback.print_exc()
        code = 1
    blender.unregister()
    sys.stdout.flush()
    sys.stderr.flush()
    # Some versions of bpy crash or hang at a normal exit.
    os._exit(code)


if __name__ == "__main__":
    main()
