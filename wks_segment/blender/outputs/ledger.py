"""The note on a mesh: what of it is ours, so that Clear removes just that."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core.mesh.triangle_mesh import IntArray
from .vertex_groups import free_name

NOTE = "wks_segment_note"
"""Custom property of a mesh: which attributes, vertex groups and slots are ours, and what was active before."""


def note_of(mesh: bpy.types.Mesh) -> dict[str, Any]:
    """What is noted on a mesh, to read; empty if there is nothing of ours."""
    return mesh[NOTE].to_dict() if has_note(mesh) else {}


def has_note(mesh: bpy.types.Mesh) -> bool:
    """Whether a mesh carries a note of ours, rather than none or somebody else's property."""
    return NOTE in mesh and hasattr(mesh[NOTE], "to_dict")


def open_note(mesh: bpy.types.Mesh) -> Any:
    """The note on a mesh, to write to; a new one if there is none."""
    if not has_note(mesh):
        mesh[NOTE] = {}
    return mesh[NOTE]


def add_attribute(
    mesh: bpy.types.Mesh, key: str, name: str, kind: str, domain: str, values: NDArray[np.generic]
) -> None:  # fmt: skip
    """Add an attribute and note the name that it got: a name that is taken gets a number."""
    attribute = mesh.attributes.new(free_name(mesh, name), kind, domain)
    mesh[NOTE][key] = attribute.name
    attribute.data.foreach_set("value", values)


def read_ints(mesh: bpy.types.Mesh, name: str) -> IntArray | None:
    """(p,) values of an int attribute of faces; None if there is none of that name."""
    attribute = mesh.attributes.get(name)
    if attribute is None or (attribute.data_type, attribute.domain) != ("INT", "FACE"):
        return None
    values = np.empty(len(attribute.data), dtype=np.int32)
    attribute.data.foreach_get("value", values)
    return values.astype(np.int64)


def read_attribute(mesh: bpy.types.Mesh, name: str, dtype: type) -> NDArray[Any] | None:
    """(k,) values of an attribute of that name; None if there is none."""
    attribute = mesh.attributes.get(name)
    if attribute is None:
        return None
    values: NDArray[Any] = np.empty(len(attribute.data), dtype=dtype)
    attribute.data.foreach_get("value", values)
    return values
