"""Files that an opened file takes data from, and that are not there: Blender leaves the data out without an error."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import bpy

KINDS = ("objects", "meshes", "armatures", "actions", "collections", "node_groups", "shape_keys")
"""Kinds of data-blocks that a character is made of."""


def missing_files() -> list[str]:
    """Names of files from which libraries, caches and modifiers take data, and that are not there."""
    return list(dict.fromkeys(Path(path).name for path in _missing_paths()))


def _missing_paths() -> Iterator[str]:
    for kind in KINDS:
        for block in getattr(bpy.data, kind):
            if block.library is not None and block.is_missing:
                yield block.library.filepath
    for cache in bpy.data.cache_files:
        if not _exists(cache.filepath, cache.library):
            yield cache.filepath
    for obj in bpy.data.objects:
        for modifier in obj.modifiers:
            if modifier.type == "MESH_CACHE" and not _exists(modifier.filepath, obj.library):
                yield modifier.filepath


def _exists(path: str, library: bpy.types.Library | None) -> bool:
    return not path or Path(bpy.path.abspath(path, library=library)).exists()
