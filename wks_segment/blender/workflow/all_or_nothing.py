"""Writing that is complete or leaves everything as it was."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager

import bpy

from ..outputs.part_attributes import has_labels
from ..outputs.restore_point import restore_point
from ..scene.characters import with_rigged


@contextmanager
def all_or_nothing(context: bpy.types.Context, written: Iterable[bpy.types.Object] = ()) -> Iterator[None]:
    """Undo what the block has written if it ends with an error.

    Parameters
    ----------
    written
        Objects that are written to beside the selected ones and those that have segments.
    """
    selected = with_rigged(context.selected_objects, context.visible_objects)
    labeled = (obj for obj in bpy.data.objects if obj.type == "MESH" and has_labels(obj.data))
    meshes = dict.fromkeys(obj.data for obj in (*written, *selected, *labeled))
    # Blender reads and writes whole attributes only outside of Edit Mode.
    with restore_point(context, [mesh for mesh in meshes if mesh.library is None and not mesh.is_editmode]):
        yield
