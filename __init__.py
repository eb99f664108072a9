"""The extension's door: Blender enables this folder, the package inside does the work."""

from .wks_segment.blender import register, unregister  # noqa: F401
