"""Entry of the extension: Blender imports this folder, and the code is in the package inside."""

from .wks_segment.blender import register, unregister  # noqa: F401
