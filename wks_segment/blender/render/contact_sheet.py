"""Render a contact sheet: poses side by side, each polygon in the color of its part."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from math import ceil
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix, Vector

from ...core.files.whole_file import whole_file
from ...core.mesh.triangle_mesh import FloatArray, IntArray
from ..errors import UserError
from ..parts.part_style import PLAIN, Style
from ..scene.attributes import read_floats, write_attribute
from ..scene.characters import Character
from ..scene.complete_files import check_complete
from ..scene.file_formats import not_written
from ..scene.poses import Pose
from ..streams import silent

TILE_PIXELS = 480
"""Usual width and height of the tile of a pose, in pixels. Without a graphics card, time grows with their number."""
TILES_IN_ROW = 4
VIEW_DIRECTION = Vector((-0.85, -1.0, 0.45))
"""Direction from the poses to the camera: front left and slightly above, for a character that faces −Y."""
TILE_SCALE = 1.16
"""Width and height of a tile, relative to the largest pose of its character; leaves room for the caption."""
CAPTION_SIZE, CAPTION_WIDTH = 0.05, 0.94
"""Height of captions and their largest width, in tiles."""
LEAST_SHRUNK = 0.6
"""Size of text, relative to its usual one, below which it is cut short instead: smaller letters cannot be read."""
BACKGROUND = (0.82, 0.82, 0.84)
"""Linear RGB of the background."""
CAPTION_COLOR = (0.05, 0.05, 0.05)
"""sRGB of captions."""
NO_PART_COLOR = 0.6
"""sRGB gray value of triangles that belong to no polygon of the character's own mesh."""
PICTURE_COLORS = "color"


@dataclass(frozen=True)
class Tile:
    """One pose of a contact sheet, with the label of each polygon and a caption."""

    pose: Pose
    labels: IntArray
    caption: str


def render_poses(
    tiles: Sequence[Tile], path: Path, columns: int = TILES_IN_ROW, style: Style = PLAIN, pixels: int = TILE_PIXELS
) -> None:
    """Render poses to one PNG file, with `columns` tiles of so many pixels in a row, in the colors of a style.

    All poses of a character have one scale, and each character fills its tiles.

    The temporary scene that is used for it is removed.

    Raises
    ------
    UserError
        If the picture cannot be rendered or written.
    """
    columns = min(columns, len(tiles))
    rows = ceil(len(tiles) / columns)
    toward = VIEW_DIRECTION.normalized()
    right = Vector((0, 0, 1)).cross(toward).normalized()
    up = toward.cross(right)
    axes = np.array([right, up, toward])
    placed = [tile.pose.mesh.vertices @ axes.T for tile in tiles]
    sizes: dict[Character, float] = {}
    for tile, points in zip(tiles, placed, strict=True):
        size = TILE_SCALE * float(np.ptp(points[:, :2], axis=0).max())
        sizes[tile.pose.character] = max(size, sizes.get(tile.pose.character, 0.0))
    with picture_scene() as scene:
        for i, (tile, points) in enumerate(zip(tiles, placed, strict=True)):
            middle = (points.min(axis=0) + points.max(axis=0)) / 2
            place = np.array([i % columns, -(i // columns), 0.0])
            _add_pose(scene, (points - middle) / sizes[tile.pose.character] + place, tile, style)
            _add_caption(scene, tile.caption, place)
        _add_camera(scene, columns, rows)
        render(scene, path, pixels * columns, pixels * rows)


@contextmanager
def picture_scene() -> Iterator[bpy.types.Scene]:
    """A temporary empty scene, which is removed with everything that was added to it."""
    scene = bpy.data.scenes.new("WKS Segment picture")
    scene.world = bpy.data.worlds.new("WKS Segment picture")
    scene.world.color = BACKGROUND
    try:
        yield scene
    finally:
        for obj in list(scene.objects):
            data = obj.data
            bpy.data.objects.remove(obj)
            bpy.data.batch_remove([data])
        bpy.data.worlds.remove(scene.world)
        bpy.data.scenes.remove(scene)


def _add_pose(scene: bpy.types.Scene, points: FloatArray, tile: Tile, style: Style) -> None:
    """Add the triangles of a pose, with points in camera axes: x to the right, y up, z toward the camera."""
    mesh = bpy.data.meshes.new("pose")
    mesh.from_pydata(points.tolist(), [], tile.pose.mesh.faces.tolist())
    mesh.shade_smooth()
    paint(mesh, np.repeat(_triangle_colors(tile, style), 3, axis=0))
    scene.collection.objects.link(bpy.data.objects.new("pose", mesh))


def _triangle_colors(tile: Tile, style: Style) -> FloatArray:
    """(m, 3) color of each triangle, that of the part of its polygon."""
    polygon_of = tile.pose.polygon_of
    return np.where(polygon_of[:, None] < 0, NO_PART_COLOR, style.colors_of(tile.labels[polygon_of]))


def _add_caption(scene: bpy.types.Scene, text: str, place: FloatArray) -> None:
    letters = add_text(scene, text, CAPTION_SIZE, CAPTION_WIDTH)
    letters.location = (place[0], place[1] - 0.5 + CAPTION_SIZE / 2, 0.0)


def add_text(
    scene: bpy.types.Scene, text: str, size: float, width: float, align: str = "CENTER",
    color: tuple[float, ...] = CAPTION_COLOR,
) -> bpy.types.Object:  # fmt: skip
    """Add text as a mesh, with its base line through the origin.

    Text that is wider than allowed is made smaller, and loses its middle if it would be too small to be read: names of
    poses often differ at the end.
    """
    text = " ".join(text.split())
    mesh = _letters(text, size, align)
    share = width / max(width_of(mesh), 1e-6)
    if share < LEAST_SHRUNK:
        kept = max(int(len(text) * share / LEAST_SHRUNK) - 1, 2)
        bpy.data.meshes.remove(mesh)
        mesh = _letters(f"{text[: kept - kept // 2]}…{text[len(text) - kept // 2 :]}", size, align)
        share = width / max(width_of(mesh), 1e-6)
    mesh.transform(Matrix.Scale(min(share, 1.0), 4))
    paint(mesh, np.tile(color, (len(mesh.loops), 1)))
    caption = bpy.data.objects.new("caption", mesh)
    scene.collection.objects.link(caption)
    return caption


def width_of(mesh: bpy.types.Mesh) -> float:
    """Extent of a mesh along x."""
    x = read_floats(mesh.vertices, "co", 3)[:, 0]
    return float(np.ptp(x)) if len(x) else 0.0


def _letters(text: str, size: float, align: str) -> bpy.types.Mesh:
    """A mesh of the letters of a text: only a mesh can have a color attribute."""
    curve = bpy.data.curves.new("caption", "FONT")
    curve.body = text
    curve.size = size
    curve.align_x = align
    letters = bpy.data.objects.new("caption", curve)
    mesh = bpy.data.meshes.new_from_object(letters)
    bpy.data.objects.remove(letters)
    bpy.data.curves.remove(curve)
    return mesh


def paint(mesh: bpy.types.Mesh, srgb: FloatArray) -> None:
    """Set the color of each corner of a mesh; srgb is an array (corners, 3)."""
    colors = np.ones((len(mesh.loops), 4), dtype=np.float32)
    colors[:, :3] = srgb
    attribute = mesh.color_attributes.new(PICTURE_COLORS, "BYTE_COLOR", "CORNER")
    write_attribute(attribute, colors)
    mesh.color_attributes.active_color = attribute


def _add_camera(scene: bpy.types.Scene, columns: int, rows: int) -> None:
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    camera.data.type = "ORTHO"
    camera.data.ortho_scale = max(columns, rows)
    camera.data.clip_end = 100.0
    camera.matrix_world = Matrix.Translation(((columns - 1) / 2, -(rows - 1) / 2, 10.0))
    scene.collection.objects.link(camera)
    scene.camera = camera


def render(scene: bpy.types.Scene, path: Path, width: int, height: int, light: str = "STUDIO") -> None:
    """Render a scene to a PNG file, in the colors of its meshes; UserError if it cannot be rendered or written."""
    scene.render.engine = "BLENDER_WORKBENCH"
    scene.render.resolution_x, scene.render.resolution_y = width, height
    scene.render.resolution_percentage = 100
    scene.render.image_settings.file_format = "PNG"
    # In a folder with a plain name: Blender replaces braces in names, those of folders too.
    temporary = Path(tempfile.mkdtemp()) / "picture.png"
    scene.render.filepath = str(temporary)
    scene.view_settings.view_transform = "Standard"
    scene.display.render_aa = "5"  # 8 samples look the same and take half as long again without a graphics card
    shading = scene.display.shading
    shading.light, shading.color_type = light, "VERTEX"
    shading.show_cavity = light == "STUDIO"
    try:
        with silent(unless_it_fails=True):
            bpy.ops.render.render(write_still=True, scene=scene.name)
        check_complete(temporary)
        with whole_file(path, check_complete) as unfinished:
            shutil.copyfile(temporary, unfinished)
    except RuntimeError as error:
        raise UserError("{path}: the picture could not be rendered: {reason}", path=path, reason=error) from error
    except OSError as error:
        raise not_written(path, error) from error
    finally:
        shutil.rmtree(temporary.parent, ignore_errors=True)
