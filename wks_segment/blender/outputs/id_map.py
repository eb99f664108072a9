"""The ID map: an image of the parts' flat colors, which pixels it has, and how to take it back."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
import numpy as np
from scipy.ndimage import distance_transform_edt

from ...core.mesh.triangle_mesh import IntArray
from ..errors import UserError
from ..parts.part_style import Style
from ..scene.attributes import write_pixels
from .ledger import NOTE, note_of, open_note

NAME = "{} ID Map"
MARK = "wks_segment_id_map"
"""Custom property of our images."""
NOTHING = -1
"""In a map of parts: no face is there."""


def with_margin(part_map: IntArray, margin: int) -> IntArray:
    """A (size, size) map of parts, each pixel without one and at most so many pixels away with that of the nearest."""
    empty = part_map == NOTHING
    distance, nearest = distance_transform_edt(empty, return_indices=True)
    return np.where(distance <= margin, part_map[tuple(nearest)], NOTHING)


def write_id_map(
    meshes: list[bpy.types.Mesh], name: str, part_map: IntArray, style: Style
) -> bpy.types.Image:  # fmt: skip
    """Make an image of a (size, size) map of parts, from the bottom row up, in the place of an earlier one of ours.

    Each pixel has exactly the color of its part, in 8 bits, and is black where no part is. The image is data: its
    numbers are not changed by color management. It is kept in the .blend file.
    """
    size = len(part_map)
    old = [note_of(mesh) for mesh in meshes]
    image = _ours(old[0].get("id_map", ""))
    if image is None or _noted(image) - set(meshes):
        image = bpy.data.images.new(name, size, size, alpha=False, is_data=True)
        image[MARK] = True
        image.use_fake_user = True  # or it would not be saved, as nothing uses it yet
    if tuple(image.size) != (size, size):
        image.scale(size, size)
    numbers, row = np.unique(part_map, return_inverse=True)
    colors = np.zeros((len(numbers), 4), dtype=np.float32)
    colors[:, 3] = 1.0
    there = numbers != NOTHING
    colors[there, :3] = np.rint(255 * style.colors_of(numbers[there])) / 255
    write_pixels(image, colors[row.reshape(part_map.shape)])
    image.update()
    image.pack()
    for mesh in meshes:
        open_note(mesh)["id_map"] = image.name
    for note in old:
        remove_id_map(note)
    return image


def remove_id_map(note: dict[str, Any]) -> None:
    """Remove the image that is noted, unless another mesh is in it too or the artist uses it."""
    image = _ours(note.get("id_map", ""))
    if image is None or _noted(image):
        return
    if all(isinstance(user, bpy.types.Screen) for user in bpy.data.user_map(subset=[image])[image]):
        bpy.data.images.remove(image)


def save(image: bpy.types.Image, path: Path) -> None:
    """Write an image to a .png file; UserError if it cannot be written."""
    image.file_format = "PNG"
    # Older Blender always saves a copy, and has no word for it.
    as_copy = {"save_copy": True} if "save_copy" in image.bl_rna.functions["save"].parameters else {}
    try:
        image.save(filepath=str(path.resolve()), **as_copy)
    except RuntimeError as error:
        raise UserError(f"{path}: the image could not be written: {str(error).strip()}") from error
    if not path.is_file():
        raise UserError(f"{path}: the image could not be written")


def _ours(name: str) -> bpy.types.Image | None:
    """The image of that name, if it is one of ours."""
    image = bpy.data.images.get(name)
    return image if image is not None and MARK in image else None


def _noted(image: bpy.types.Image) -> set[bpy.types.Mesh]:
    """Meshes that are in an image."""
    return {mesh for mesh in bpy.data.meshes if NOTE in mesh and note_of(mesh).get("id_map") == image.name}
