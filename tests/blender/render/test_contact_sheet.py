"""Contact sheets: colors of parts, arrangement, scale, captions, and removal of temporary data."""

from dataclasses import replace

import bpy
import numpy as np
import pytest
from builders import changes, limbed_poses, scene_snapshot

from wks_segment.blender.errors import UserError
from wks_segment.blender.parts.palette import palette
from wks_segment.blender.parts.part_style import Style
from wks_segment.blender.render.contact_sheet import TILE_PIXELS, Tile, render_poses
from wks_segment.blender.scene import poses as reader
from wks_segment.blender.scene.poses import Character
from wks_segment.core import TriangleMesh

pytestmark = pytest.mark.usefixtures("scene", "needs_rendering")
PARTS = (0, 3, 7)
"""Parts in the picture."""


def tiles(count):
    poses = [
        reader.read_objects(bpy.context, [Character((obj,))])[0]
        for obj in limbed_poses(*np.linspace(0, 0.8, count), subdivisions=3)
    ]
    result = []
    for pose in poses:
        height = pose.mesh.vertices[pose.mesh.faces].mean(axis=1)[:, 2]
        result.append(Tile(pose, np.array(PARTS)[np.digitize(height, (-0.4, 0.3))], pose.name))
    return result


def pixels(path):
    """(height, width, 3) sRGB colors, the top row first."""
    image = bpy.data.images.load(str(path))
    width, height = image.size
    values = np.empty(width * height * image.channels, dtype=np.float32)
    image.pixels.foreach_get(values)
    bpy.data.images.remove(image)
    return values.reshape(height, width, -1)[::-1, :, :3]


def hues(colors):
    """Hue, from 0 to 1, and saturation of (…, 3) colors."""
    low, high = colors.min(axis=-1), colors.max(axis=-1)
    red, green, blue = np.moveaxis(colors, -1, 0)
    angle = np.arctan2(np.sqrt(3) * (green - blue), 2 * red - green - blue) / (2 * np.pi) % 1
    return angle, (high - low) / np.maximum(high, 1e-6)


def share_of(part, image):
    """Share of an image with the hue of a part."""
    hue, saturation = hues(image)
    own, _ = hues(palette()[part])
    away = np.abs(hue - own)
    return ((np.minimum(away, 1 - away) < 0.03) & (saturation > 0.25)).mean()


def test_picture_shows_each_pose_in_the_colors_of_its_parts(tmp_path):
    path = tmp_path / "poses.png"
    render_poses(tiles(2), path)
    image = pixels(path)
    assert image.shape == (TILE_PIXELS, 2 * TILE_PIXELS, 3)
    for half in (image[:, :TILE_PIXELS], image[:, TILE_PIXELS:]):
        for part in PARTS:
            assert share_of(part, half) > 0.01, part
        assert share_of(1, half) < 0.002
        background = np.abs(half - half[2, 2]).max(axis=-1) < 0.02
        assert 0.3 < background.mean() < 0.95


def test_picture_shows_the_users_colors(tmp_path):
    path, given = tmp_path / "poses.png", {part: palette()[1] for part in PARTS}
    render_poses(tiles(1), path, style=Style(colors=given))
    image = pixels(path)
    assert share_of(1, image) > 0.03
    assert all(share_of(part, image) < 0.002 for part in PARTS)


def test_poses_are_arranged_in_rows(tmp_path):
    path = tmp_path / "poses.png"
    render_poses(tiles(3), path, columns=2)
    image = pixels(path)
    assert image.shape == (2 * TILE_PIXELS, 2 * TILE_PIXELS, 3)
    assert share_of(PARTS[1], image[TILE_PIXELS:, :TILE_PIXELS]) > 0.01
    assert share_of(PARTS[1], image[TILE_PIXELS:, TILE_PIXELS:]) == 0


def test_each_character_fills_its_tiles(tmp_path):
    """All of its poses with one scale: a pose that is half as large is shown so."""
    large, tiny, half = tiles(3)
    as_large = replace(large, pose=replace(large.pose, mesh=scaled(large.pose.mesh, 1000)))
    as_half = replace(half, pose=replace(half.pose, character=tiny.pose.character, mesh=scaled(tiny.pose.mesh, 0.5)))
    path = tmp_path / "poses.png"
    render_poses([as_large, tiny, as_half], path)
    covered = [(hues(image)[1] > 0.25).any(axis=0).mean() for image in np.split(pixels(path), 3, axis=1)]
    assert min(covered[:2]) > 0.6
    assert covered[2] == pytest.approx(covered[1] / 2, rel=0.15)


def scaled(mesh, factor):
    return TriangleMesh(mesh.vertices * factor, mesh.faces)


@pytest.mark.parametrize("name", ["W" * 200, "a name, frame 120 " * 4, "line\nbreak " * 9], ids=["W", "words", "lines"])
def test_captions_do_not_overlap(tmp_path, name):
    path = tmp_path / "poses.png"
    render_poses([replace(tile, caption=name) for tile in tiles(3)], path)
    image = pixels(path)
    dark = image[int(0.92 * TILE_PIXELS) :].max(axis=-1) < 0.5
    for i in range(3):
        own = dark[:, i * TILE_PIXELS : (i + 1) * TILE_PIXELS].any(axis=0)
        assert own.mean() > 0.3, "the caption is there"
        assert not own[:5].any()
        assert not own[-5:].any()


def test_the_temporary_scene_is_removed(tmp_path):
    shown = tiles(2)
    bpy.context.scene.frame_set(5)
    before = scene_snapshot()
    kinds = ("meshes", "objects", "cameras", "curves", "scenes", "worlds", "materials")
    blocks = {name: len(getattr(bpy.data, name)) for name in kinds}
    render_poses(shown, tmp_path / "poses.png")
    assert not changes(before, scene_snapshot())
    assert {name: len(getattr(bpy.data, name)) for name in blocks} == blocks


def test_the_temporary_scene_is_removed_after_a_failure(tmp_path):
    shown = tiles(1)
    (tmp_path / "file").write_text("a file, where a folder is needed")
    before = scene_snapshot()
    with pytest.raises(UserError, match=r"poses\.png"):
        render_poses(shown, tmp_path / "file" / "poses.png")
    assert not changes(before, scene_snapshot())
