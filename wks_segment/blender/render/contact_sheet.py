"""A picture of poses side by side, each polygon in the color of its segment."""

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

from ...core.mesh.triangle_mesh import FloatArray, IntArray
from ..errors import UserError
from ..parts.part_style import PLAIN, Style
from ..scene.attributes import write_attribute
from ..scene.poses import Pose

TILE = 480
"""Width and height of a pose in the picture, in pixels."""
COLUMNS = 4
VIEW = Vector((-0.85, -1.0, 0.45))
"""From where the camera looks: front left, a little from above, for a character that faces −Y."""
MARGIN = 1.16
"""Width and height of a tile, in those of the largest pose: leaves room for the caption."""
CAPTION_SIZE = 0.05
"""Height of the letters, in tiles."""
BACKGROUND = (0.82, 0.82, 0.84)
"""Linear RGB of what is behind the poses."""
CAPTION_COLOR = (0.05, 0.05, 0.05)
"""sRGB of the letters."""
COLORS = "color"


@dataclass(frozen=True)
class Tile:
    """One pose in the picture."""

    pose: Pose
    labels: IntArray
    caption: str


def render_poses(tiles: Sequence[Tile], path: Path, columns: int = COLUMNS, style: Style = PLAIN) -> None:
    """Render poses into one PNG file, `columns` in a row, in the colors of a style.

    Uses a scene of its own, which is gone afterwards.

    Raises
    ------
    UserError
        If the picture cannot be rendered or written.
    """
    columns = min(columns, len(tiles))
    rows = ceil(len(tiles) / columns)
    towards = VIEW.normalized()
    right = Vector((0, 0, 1)).cross(towards).normalized()
    up = towards.cross(right)
    axes = np.array([right, up, towards])
    placed = [tile.pose.mesh.vertices @ axes.T for tile in tiles]
    side = MARGIN * max(float(np.ptp(points[:, :2], axis=0).max()) for points in placed)
    with picture_scene() as scene:
        for i, (tile, points) in enumerate(zip(tiles, placed, strict=True)):
            middle = (points.min(axis=0) + points.max(axis=0)) / 2
            place = np.array([i % columns, -(i // columns), 0.0]) * side
            _add_pose(scene, (points - middle + place) / side, tile, style)
            _add_caption(scene, tile.caption, place / side)
        _add_camera(scene, columns, rows)
        render(scene, path, TILE * columns, TILE * rows)


@contextmanager
def picture_scene() -> Iterator[bpy.types.Scene]:
    """An empty scene that takes all that was added to it along when it goes."""
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
    """The triangles of a pose in the camera's own axes: x to the right, y up, z towards it."""
    mesh = bpy.data.meshes.new("pose")
    mesh.from_pydata(points.tolist(), [], tile.pose.mesh.faces.tolist())
    mesh.shade_smooth()
    paint(mesh, np.repeat(_triangle_colors(tile, style), 3, axis=0))
    scene.collection.objects.link(bpy.data.objects.new("pose", mesh))


def _triangle_colors(tile: Tile, style: Style) -> FloatArray:
    """(m, 3) color of each triangle; gray where it is of no polygon of the character's own."""
    polygon_of = tile.pose.polygon_of
    return np.where(polygon_of[:, None] < 0, 0.6, style.colors_of(tile.labels[polygon_of]))


def _add_caption(scene: bpy.types.Scene, text: str, place: FloatArray) -> None:
    letters = add_text(scene, text, CAPTION_SIZE)
    letters.location = (place[0], place[1] - 0.5 + CAPTION_SIZE / 2, 0.0)


def add_text(
    scene: bpy.types.Scene, text: str, size: float, align: str = "CENTER", color: tuple[float, ...] = CAPTION_COLOR
) -> bpy.types.Object:
    """Letters as a mesh, on a line through the origin."""
    curve = bpy.data.curves.new("caption", "FONT")
    curve.body = text
    curve.size = size
    curve.align_x = align
    letters = bpy.data.objects.new("caption", curve)
    # Letters take a color only as a mesh.
    mesh = bpy.data.meshes.new_from_object(letters)
    bpy.data.objects.remove(letters)
    bpy.data.curves.remove(curve)
    paint(mesh, np.tile(color, (len(mesh.loops), 1)))
    caption = bpy.data.objects.new("caption", mesh)
    scene.collection.objects.link(caption)
    return caption


def paint(mesh: bpy.types.Mesh, srgb: FloatArray) -> None:
    """Give each corner of a mesh one of the (corners, 3) colors."""
    colors = np.ones((len(mesh.loops), 4), dtype=np.float32)
    colors[:, :3] = srgb
    attribute = mesh.color_attributes.new(COLORS, "BYTE_COLOR", "CORNER")
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
    """Render a scene to a PNG file, in the colors of its meshes; UserError if that fails or it cannot be written."""
    scene.render.engine = "BLENDER_WORKBENCH"
    scene.render.resolution_x, scene.render.resolution_y = width, height
    scene.render.resolution_percentage = 100
    scene.render.image_settings.file_format = "PNG"
    # A plain name, since Blender takes braces for templates and adds a suffix that it misses.
    temporary = Path(tempfile.mkdtemp()) / "picture.png"
    scene.render.filepath = str(temporary)
    scene.view_settings.view_transform = "Standard"
    shading = scene.display.shading
    shading.light, shading.color_type = light, "VERTEX"
    shading.show_cavity = light == "STUDIO"
    try:
        bpy.ops.render.render(write_still=True, scene=scene.name)
    except RuntimeError as error:
        raise UserError(f"{path}: the picture could not be rendered: {error}") from error
    try:
        shutil.move(temporary, path)
    except OSError as error:
        raise UserError(f"{path}: the picture could not be written: {error.strerror or error}") from error
    finally:
        shutil.rmtree(temporary.parent, ignore_errors=True)
