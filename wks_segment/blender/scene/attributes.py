"""Reads and writes Blender's arrays as NumPy arrays: properties of collections, attributes of meshes, pixels of images.

The only module that calls `foreach_get` and `foreach_set`, which need an array of exactly the property's type: with
another one they copy number by number.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, TypeAlias

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core.mesh.triangle_mesh import BoolArray, IntArray

Elements: TypeAlias = bpy.types.bpy_prop_collection
"""A collection of elements with the same properties, such as `mesh.vertices` or `attribute.data`."""
Float32Array: TypeAlias = NDArray[np.float32]


@dataclass(frozen=True)
class _AttributeType:
    """The property that holds the values of an attribute's type, how many numbers one value has, and their type."""

    prop: str
    width: int
    dtype: type[np.generic]


_ATTRIBUTE_TYPES = {
    "BOOLEAN": _AttributeType("value", 1, np.bool_),
    "INT": _AttributeType("value", 1, np.int32),
    "FLOAT": _AttributeType("value", 1, np.float32),
    "FLOAT2": _AttributeType("vector", 2, np.float32),
    "FLOAT_VECTOR": _AttributeType("vector", 3, np.float32),
    "BYTE_COLOR": _AttributeType("color_srgb", 4, np.float32),
    "FLOAT_COLOR": _AttributeType("color", 4, np.float32),
}
"""By the name of the type in Blender. Colors are read and written as they are stored: bytes as sRGB, floats linear."""
OUR_HIDDEN_ATTRIBUTE = ".wks_segment_written"
"""Face attribute of ours that lists do not show: not 0 on faces that were written to."""


def read_floats(elements: Elements, prop: str, width: int = 1) -> Float32Array:
    """(n,) or, if width is above 1, (n, width) values of a property of n elements."""
    return _read(elements, prop, width, np.float32)


def read_ints(elements: Elements, prop: str, width: int = 1) -> IntArray:
    """(n,) or, if width is above 1, (n, width) values of a property of n elements."""
    return _read(elements, prop, width, np.int32).astype(np.int64)


def read_bools(elements: Elements, prop: str) -> BoolArray:
    """(n,) values of a property of n elements."""
    return _read(elements, prop, 1, np.bool_)


def read_numbers(elements: Elements, prop: bpy.types.Property) -> NDArray[Any] | None:
    """(n * width,) values of any property of n elements that are numbers; None if Blender does not give them at once.

    Parameters
    ----------
    prop
        The property as `bl_rna` of an element describes it.
    """
    dtype = {"BOOLEAN": np.bool_, "INT": np.int32, "FLOAT": np.float32}[prop.type]
    width = prop.array_length if prop.is_array else 1
    values = np.empty(len(elements) * width, dtype=dtype)
    try:
        elements.foreach_get(prop.identifier, values)
    except (AttributeError, RuntimeError, TypeError):
        return None
    return values


def write_floats(elements: Elements, prop: str, values: NDArray[Any]) -> None:
    """Set a property of n elements to (n,) or (n, width) values."""
    _write(elements, prop, values, np.float32)


def write_ints(elements: Elements, prop: str, values: NDArray[Any]) -> None:
    """Set a property of n elements to (n,) or (n, width) values."""
    _write(elements, prop, values, np.int32)


def write_bools(elements: Elements, prop: str, values: NDArray[Any]) -> None:
    """Set a property of n elements to (n,) values."""
    _write(elements, prop, values, np.bool_)


def is_readable(attribute: bpy.types.Attribute) -> bool:
    """Whether `read_attribute` can read it: some of Blender's own, whose names start with a dot, have a wrong type."""
    hidden = attribute.name.startswith(".") and attribute.name not in (".sculpt_face_set", OUR_HIDDEN_ATTRIBUTE)
    return attribute.data_type in _ATTRIBUTE_TYPES and not hidden


def read_attribute(mesh: bpy.types.Mesh, name: str) -> NDArray[Any] | None:
    """(n,) or (n, width) values of a mesh attribute, whose type they have; None if the mesh has none of that name."""
    attribute = mesh.attributes.get(name)
    if attribute is None:
        return None
    kind = _ATTRIBUTE_TYPES[attribute.data_type]
    return _read(attribute.data, kind.prop, kind.width, kind.dtype)


def read_face_ints(mesh: bpy.types.Mesh, name: str) -> IntArray | None:
    """(p,) values of an integer attribute of the p polygons; None if the mesh has no such attribute of that name."""
    attribute = mesh.attributes.get(name)
    if attribute is None or (attribute.data_type, attribute.domain) != ("INT", "FACE"):
        return None
    return read_ints(attribute.data, "value")


def write_attribute(attribute: bpy.types.Attribute, values: NDArray[Any]) -> None:
    """Set the n values of an attribute of a mesh, (n,) or (n, width); they are cast to its type."""
    kind = _ATTRIBUTE_TYPES[attribute.data_type]
    _write(attribute.data, kind.prop, values, kind.dtype)


def new_attribute(
    mesh: bpy.types.Mesh, name: str, data_type: str, domain: str, values: NDArray[Any]
) -> bpy.types.Attribute:
    """Add an attribute with these values to a mesh; a name that is taken by another attribute gets a number."""
    attribute = mesh.attributes.new(name, data_type, domain)
    write_attribute(attribute, values)
    return attribute


def remove_attribute(mesh: bpy.types.Mesh, name: str) -> None:
    """Remove the attribute of that name, if the mesh has one."""
    attribute = mesh.attributes.get(name)
    if attribute is not None:
        mesh.attributes.remove(attribute)


def read_pixels(image: bpy.types.Image) -> Float32Array:
    """(height, width, channels) values of the pixels of an image, from the bottom row up."""
    width, height = image.size
    pixels = np.empty(width * height * image.channels, dtype=np.float32)
    image.pixels.foreach_get(pixels)
    return pixels.reshape(height, width, image.channels)


def write_pixels(image: bpy.types.Image, pixels: NDArray[Any]) -> None:
    """Set the (height, width, channels) values of the pixels of an image, from the bottom row up."""
    image.pixels.foreach_set(np.ascontiguousarray(pixels, dtype=np.float32).ravel())


def _read(elements: Elements, prop: str, width: int, dtype: type[np.generic]) -> NDArray[Any]:
    values: NDArray[Any] = np.empty(len(elements) * width, dtype=dtype)
    elements.foreach_get(prop, values)
    return values if width == 1 else values.reshape(-1, width)


def _write(elements: Elements, prop: str, values: NDArray[Any], dtype: type[np.generic]) -> None:
    elements.foreach_set(prop, np.ascontiguousarray(values, dtype=dtype).ravel())
