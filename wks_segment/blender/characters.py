"""How objects are grouped to characters, for scripts."""

from .scene.characters import Character, group, mesh_objects, selected_meshes

__all__ = ["Character", "group", "mesh_objects", "selected_meshes"]
