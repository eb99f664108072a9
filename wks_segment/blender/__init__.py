"""The Blender extension. Only this package imports `bpy`.

Scripts in Blender find here `commands.run`, the command line, and in the modules `characters` and `poses` how objects
are grouped and read.
"""

from .cli import main as commands
from .registration import register, unregister

__all__ = ["commands", "register", "unregister"]
