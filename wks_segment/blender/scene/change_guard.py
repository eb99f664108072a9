"""Detects changes of meshes and of the scene after they were read, so that nothing is written to a changed mesh."""

from __future__ import annotations

from collections.abc import Iterable
from hashlib import blake2b

import bpy

from ..errors import ChangedError
from .attributes import read_floats, read_ints
from .characters import Character, Member
from .topology import polygon_sizes


class ChangeGuard:
    """Remembers a scene and the meshes of characters as they are now, without references to Blender's data."""

    def __init__(self, scene: bpy.types.Scene, characters: Iterable[Character]) -> None:
        self._scene = scene.name, scene.session_uid
        objects = {member: member.resolve() for character in characters for member in character.members}
        self._states = {
            member: (_mesh_state(obj), _content(obj.data)) for member, obj in objects.items() if obj is not None
        }

    def check_quickly(self) -> None:
        """Raise ChangedError if a change can be seen without reading meshes: fast enough for many times a second."""
        self.scene()
        for member, (state, _) in self._states.items():
            _check_member(member, member.resolve(), state)

    def check_fully(self) -> None:
        """Raise ChangedError also if coordinates or faces changed: slower, for once before something is written."""
        self.check_quickly()
        for member, (_, content) in self._states.items():
            obj = member.resolve()
            if obj is not None and _content(obj.data) != content:
                raise ChangedError('the mesh of "{name}" was edited', name=member.name)

    def scene(self) -> bpy.types.Scene:
        """The scene; ChangedError if it was deleted."""
        name, uid = self._scene
        scene = bpy.data.scenes.get(name)
        if scene is None or scene.session_uid != uid:
            scene = next((other for other in bpy.data.scenes if other.session_uid == uid), None)
        if scene is None:
            raise ChangedError('the scene "{name}" was deleted', name=name)
        return scene


def _mesh_state(obj: bpy.types.Object) -> tuple[str, int, int]:
    """Mode and numbers of vertices and polygons of an object, which are cheap to read."""
    # A mesh can be in Edit Mode through another object.
    return "EDIT" if obj.data.is_editmode else obj.mode, len(obj.data.vertices), len(obj.data.polygons)


def _check_member(member: Member, obj: bpy.types.Object | None, state: tuple[str, int, int]) -> None:
    if obj is None:
        raise ChangedError('"{name}" was deleted', name=member.name)
    if obj.data.session_uid != member.mesh_uid:
        raise ChangedError('"{name}" has another mesh now', name=member.name)
    mode, *size = _mesh_state(obj)
    if mode != state[0]:
        raise ChangedError('"{name}" went into {mode} Mode', name=member.name, mode=mode.replace("_", " ").title())
    if tuple(size) != state[1:]:
        raise ChangedError('the mesh of "{name}" was edited', name=member.name)


def _content(mesh: bpy.types.Mesh) -> bytes:
    """Hash of the coordinates and faces of a mesh."""
    digest = blake2b(digest_size=16)
    for values in (read_floats(mesh.vertices, "co", 3), read_ints(mesh.loops, "vertex_index"), polygon_sizes(mesh)):
        digest.update(values.tobytes())
    return digest.digest()
