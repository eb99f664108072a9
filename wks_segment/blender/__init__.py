"""The Blender extension. Only this package imports `bpy`."""

from .registration import register, unregister

__all__ = ["register", "unregister"]
