"""Restore points: an error while something is written leaves everything as it was before.

Blender's undo cannot do that: it must not be called while an operator runs, and there is none on the command line. So
inside of a restore point nothing is removed for good before all is written, and what was changed is kept.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Any

import bpy

from .mesh_state import MeshState
from .property_state import PropertyState

LONGEST_BLOCK_NAME = 63
"""Bytes of a name, of which Blender 4.2 keeps no more."""


class RestorePoint:
    """The state of some meshes, of the objects' visibility and selection, and of the settings of all scenes."""

    def __init__(self, context: bpy.types.Context, meshes: Iterable[bpy.types.Mesh]) -> None:
        self.undo_steps: list[Callable[[], None]] = []
        self.doomed: list[bpy.types.ID] = []
        self._layer = context.view_layer
        self._active = self._layer.objects.active
        self._shown = {obj: _shown(obj) for obj in self._layer.objects}
        self._known = {_key(block) for block in _all_blocks()}
        self._meshes = [MeshState(mesh) for mesh in dict.fromkeys(meshes)]
        self._settings = [(scene, PropertyState(scene.wks_segment)) for scene in bpy.data.scenes]

    def restore(self) -> None:
        """Bring everything back."""
        bpy.data.batch_remove([block for block in _all_blocks() if _key(block) not in self._known])
        for step in reversed(self.undo_steps):
            step()
        for state in self._meshes:
            state.restore()
        for scene, settings in self._settings:
            settings.restore(scene.wks_segment)
        for obj, shown in self._shown.items():
            if _shown(obj) == shown:
                continue
            selected, hidden, hidden_in_renders = shown
            obj.hide_set(False, view_layer=self._layer)  # what is hidden cannot be selected
            obj.select_set(selected, view_layer=self._layer)
            obj.hide_set(hidden, view_layer=self._layer)
            obj.hide_render = hidden_in_renders
        self._layer.objects.active = self._active

    def finish(self) -> None:
        """Remove what is to be removed."""
        bpy.data.batch_remove(dict.fromkeys(self.doomed))


_open: list[RestorePoint] = []
"""The restore point that is in force, if there is one."""


@contextmanager
def restore_point(context: bpy.types.Context, meshes: Iterable[bpy.types.Mesh]) -> Iterator[None]:
    """Undo everything that the block has written if it ends with an error. One within another adds nothing."""
    if _open:
        yield
        return
    point = RestorePoint(context, meshes)
    _open.append(point)
    try:
        yield
    except BaseException:
        point.restore()
        raise
    else:
        point.finish()
    finally:
        _open.clear()


def on_failure(step: Callable[[], None]) -> None:
    """Let a restore point do this as well, to bring back what it does not know."""
    if _open:
        _open[0].undo_steps.append(step)


def remove(block: Any) -> None:
    """Remove a data-block, at the end of the restore point if there is one. Its name is free at once."""
    if not _open:
        bpy.data.batch_remove([block])
        return
    name, collections = block.name, list(getattr(block, "users_collection", []))

    def bring_back() -> None:
        block.name = name
        for collection in collections:
            if block.name not in collection.objects:
                collection.objects.link(block)

    on_failure(bring_back)
    _open[0].doomed.append(block)
    block.name = f"{name[: LONGEST_BLOCK_NAME - 10]} (removed)"
    for collection in collections:
        collection.objects.unlink(block)


def is_removed(block: bpy.types.ID) -> bool:
    """Whether a data-block will be removed at the end of the restore point."""
    return bool(_open) and block in _open[0].doomed


def _shown(obj: bpy.types.Object) -> tuple[bool, bool, bool]:
    """Whether an object is selected, hidden and hidden in renders."""
    return obj.select_get(), obj.hide_get(), obj.hide_render


def _key(block: bpy.types.ID) -> tuple[str, int]:
    return block.bl_rna.identifier, block.session_uid


def _all_blocks() -> list[bpy.types.ID]:
    """All data-blocks of the file."""
    collections = [
        getattr(bpy.data, prop.identifier) for prop in bpy.data.bl_rna.properties if prop.type == "COLLECTION"
    ]
    return [block for collection in collections for block in collection]
