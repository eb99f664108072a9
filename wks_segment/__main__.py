"""`python -m wks_segment`: the command line without a Blender program, on the bpy module."""

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
            "wks_segment: this command needs Blender's Python module: pip install bpy, or blender --command wks_segment"
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
