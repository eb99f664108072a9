"""The Blender extension. Only this package imports `bpy`.

Scripts in Blender find here `commands.run`, the command line, and in the modules `characters` and `poses` how objects
are grouped and read.
"""

from __future__ import annotations

import importlib
from types import ModuleType

from .registration import register, unregister

__all__ = ["commands", "register", "unregister"]


def __getattr__(name: str) -> ModuleType:
    """The command line, which is imported only when it is used."""
    if name != "commands":
        raise AttributeError(name, name=name)
    return importlib.import_module(".cli.main", __name__)
