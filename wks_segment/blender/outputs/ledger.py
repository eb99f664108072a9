"""The note on a mesh: what of it is ours, so that Clear removes just that."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ..scene.attributes import write_attribute
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
    mesh[NOTE][key] = attribute.name  # before the values are written, so that Clear finds it whatever happens
    write_attribute(attribute, values)
