"""The ID map: an image with the flat colors of parts."""

from __future__ import annotations

from hashlib import blake2b
from pathlib import Path

import bpy
import numpy as np

from ...core.files.whole_file import incomplete, whole_file
from ...core.mesh.triangle_mesh import IntArray
from ...core.message import Message
from ..parts.part_style import Style
from ..scene.attributes import OUR_HIDDEN_ATTRIBUTE, read_face_ints, read_pixels, write_pixels
from ..scene.complete_files import check_complete
from ..scene.file_formats import not_written
from ..scene.fingerprint import fingerprint, users_of
from .ledger import MARK, Ledger
from .own_property import OwnProperty
from .restore_point import on_failure, remove

IMAGE_NAME = "{} ID Map"
"""Name of the image of a character or object."""
IMAGE_PROPERTY = "wks_segment_id_map"
"""Custom property of our images."""
_MADE = OwnProperty("wks_segment_id_map_made", "as")
"""Custom property of our images: hash of the pixels, and fingerprint ("as") as this Blender ("by") made them."""
JOINED = "joined_id_maps"
"""Entry of the ledger for the names of images of meshes that were joined with this one."""
NO_PART = -1
"""In a map of parts: no face covers the pixel."""


class IdMapImage:
    """An ID map that shows the parts of a mesh, alone or with other meshes."""

    keys = ("id_map", JOINED)

    def take_back(self, mesh: bpy.types.Mesh, ledger: Ledger) -> None:
        """Remove the image, unless another mesh is in it as well or the artist uses it or has painted on it."""
        names = [ledger.get("id_map", ""), *ledger.get(JOINED, [])]
        for key in self.keys:
            ledger.remove(key)
        for name in dict.fromkeys(names):
            ledger.warnings += _remove_unused(name, mesh)


def with_margin(part_map: IntArray, margin: int) -> IntArray:
    """A (size, size) map of parts, where pixels without a part take the nearest one within so many pixels."""
    import scipy

    empty = part_map == NO_PART
    distance, nearest = scipy.ndimage.distance_transform_edt(empty, return_indices=True)
    return np.where(distance <= margin, part_map[tuple(nearest)], NO_PART)


def write_id_map(
    meshes: list[bpy.types.Mesh], name: str, part_map: IntArray, style: Style, warnings: list[str]
) -> bpy.types.Image:
    """Make an image of a (size, size) map of the meshes' parts, from the bottom row up, in place of their earlier one.

    An earlier one that the artist has painted on stays; a warning says so.

    Each pixel has exactly the color of its part, in 8 bits, and is black where no part is. The image is data: color
    management does not change its numbers. It is kept in the .blend file.
    """
    size = len(part_map)
    ledgers = [Ledger(mesh) for mesh in meshes]
    old_names = [ledger.get("id_map", "") for ledger in ledgers]
    image = _our_image(old_names[0])
    if image is None or _meshes_in(image) - set(meshes) or not _is_as_made(image):
        image = bpy.data.images.new(name, size, size, alpha=False, is_data=True)
        image[IMAGE_PROPERTY] = True
        image.use_fake_user = True  # nothing uses it yet, and Blender does not save what nothing uses
    _keep_pixels(image)
    if tuple(image.size) != (size, size):
        image.scale(size, size)
    numbers, row = np.unique(part_map, return_inverse=True)
    colors = np.zeros((len(numbers), 4), dtype=np.float32)
    colors[:, 3] = 1.0
    is_part = numbers != NO_PART
    colors[is_part, :3] = np.rint(255 * style.colors_of(numbers[is_part])) / 255
    write_pixels(image, colors[row.reshape(part_map.shape)])
    image.update()
    image.pack()
    for ledger in ledgers:
        ledger["id_map"] = image.name
    made = {"pixels": _hash_of(image), "as": _fingerprint_of(image), "by": bpy.app.version_string}
    _MADE.put(image, {**made, "marks": [ledger[MARK] for ledger in ledgers]})
    for old_name in dict.fromkeys(old_names):
        warnings += _remove_unused(old_name)
    return image


def id_map_of(mesh: bpy.types.Mesh) -> bpy.types.Image | None:
    """The ID map that was baked of a mesh; None if there is none."""
    return _our_image(Ledger(mesh).get("id_map", ""))


def save_image(image: bpy.types.Image, path: Path) -> None:
    """Write an image to a .png file, which appears whole; UserError if it cannot be written."""
    image.file_format = "PNG"
    # Older versions of Blender always save a copy, and have no parameter for it.
    as_copy = {"save_copy": True} if "save_copy" in image.bl_rna.functions["save"].parameters else {}
    try:
        with whole_file(path, check_complete) as unfinished:
            try:
                image.save(filepath=str(unfinished), **as_copy)
            except RuntimeError as error:
                raise incomplete(unfinished, str(error).strip()) from error
    except OSError as error:
        raise not_written(path, error) from error


def images_of_joined(mesh: bpy.types.Mesh) -> list[str]:
    """Names of the images of meshes that were joined with a mesh, whose ledgers are lost."""
    ledger = Ledger(mesh)
    written = read_face_ints(mesh, ledger.get("written", OUR_HIDDEN_ATTRIBUTE))
    marks = set() if written is None else set(np.unique(written).tolist()) - {ledger.get(MARK, 0)}
    found = [image.name for image in bpy.data.images if marks & _marks_on(image)]
    return [*dict.fromkeys([*ledger.get(JOINED, []), *found])]


def _marks_on(image: bpy.types.Image) -> set[int]:
    """Marks of the meshes that an image of ours was baked of; older versions do not tell."""
    made = _MADE.of(image) if IMAGE_PROPERTY in image else None
    return set() if made is None else set(made.get("marks", ()))


def _remove_unused(name: str, cleared: bpy.types.Mesh | None = None) -> list[Message]:
    """Remove the image of ours with this name, if no mesh is in it and the artist neither uses nor changed it.

    Parameters
    ----------
    name
    cleared
        A mesh that is no longer in it.

    Returns
    -------
    list of Message
        That it was changed, and stays.
    """
    image = _our_image(name)
    if image is None or _meshes_in(image) - {cleared}:
        return []
    if not _is_as_made(image):
        return [Message('The image "{name}" has been changed since it was baked, and stays', name=name)]
    if not users_of(image)[image]:
        remove(image)
    return []


def _is_as_made(image: bpy.types.Image) -> bool:
    """Whether nobody has painted on an image of ours or changed its settings; older versions do not tell."""
    made = _MADE.of(image)
    if made is None:
        return not image.is_dirty
    if made["by"] != bpy.app.version_string:
        return bool(made["pixels"] == _hash_of(image))
    return bool(made["as"] == _fingerprint_of(image))


def _fingerprint_of(image: bpy.types.Image) -> str:
    # The resolution is rounded when the image is read from a file.
    return fingerprint(image, ignored=("resolution",))


def _hash_of(image: bpy.types.Image) -> str:
    return blake2b(read_pixels(image).tobytes(), digest_size=16).hexdigest()


def _keep_pixels(image: bpy.types.Image) -> None:
    """Let an error bring the pixels of an image back."""
    size, pixels, made = tuple(image.size), read_pixels(image), _MADE.of(image)
    entries = None if made is None else made.to_dict()

    def bring_back() -> None:
        image.scale(*size)
        write_pixels(image, pixels)
        image.update()
        image.pack()
        if entries is not None:
            _MADE.put(image, {**entries, "as": _fingerprint_of(image)})

    if made is not None:
        on_failure(bring_back)


def _our_image(name: str) -> bpy.types.Image | None:
    """The image of that name, if it is one of ours."""
    image = bpy.data.images.get(name)
    return image if image is not None and IMAGE_PROPERTY in image else None


def _meshes_in(image: bpy.types.Image) -> set[bpy.types.Mesh]:
    """Meshes whose parts an image shows, other than those that no object has, as joined objects leave them."""
    found = (mesh for mesh in bpy.data.meshes if mesh.users)
    return {mesh for mesh in found if image.name in (Ledger(mesh).get("id_map", ""), *images_of_joined(mesh))}
