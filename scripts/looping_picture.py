"""Make the looping picture of the README: a walk, the click, the colors, and the same colors on another body.

    python -m scripts.looping_picture FOLDER/Fox.glb FOLDER/Wolf.glb

Learns the first character by the operators, as an artist does, and applies the model to the second one. Each needs an
action with "walk" in its name. Needs bpy and Pillow (`make` installs both in .venv).
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import bpy
import numpy as np
from mathutils import Vector
from PIL import Image, ImageDraw, ImageFont

import wks_segment.blender
from scripts._pictures import FOLDER, axes_of_view, rendered, run
from wks_segment.blender.outputs.part_attributes import labels_on
from wks_segment.blender.parts.part_style import Style
from wks_segment.blender.scene import poses
from wks_segment.blender.scene.characters import Character, group
from wks_segment.core.mesh.triangle_mesh import FloatArray, IntArray

OUTPUT = FOLDER / "walk.gif"
SIZE = (640, 360)
"""Width and height of the picture, in pixels."""
FRAMES_PER_SECOND = 12
UNCOLORED, COLORED, OTHER = 22, 26, 26
"""Number of frames of each scene: six seconds in all."""
PRESSED = 17
"""Frame at which the button is pressed."""
N_COLORS = 96
"""Number of colors in the file; with fewer, shades become bands."""
VIEW_DIRECTION = Vector((-1.0, -0.75, 0.35))
"""Direction from the character to the camera."""
ROOM = 1.45
"""Width of the picture relative to the length of the first character."""
GRAY = 0.62
"""sRGB gray value of a character without segments."""
BUTTON, BUTTON_PRESSED, TEXT = (84, 84, 84), (71, 114, 179), (40, 40, 44)
"""sRGB of Blender's buttons, and of captions on the background."""
BUTTON_BOX = (26, 292, 226, 330)
CURSOR = ((0, 0), (0, 20), (5, 15), (9, 23), (12, 21), (8, 14), (15, 14))
"""Outline of the mouse pointer, from its tip."""


class Scene(NamedTuple):
    """Part of the picture: the frames of a character, in gray or in the colors of its segments."""

    caption: str
    character: Character
    labels: IntArray | None
    n_frames: int


def main() -> None:
    """Make the picture."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("learned", type=Path)
    parser.add_argument("other", type=Path)
    parser.add_argument("--output", type=Path, default=OUTPUT)
    options = parser.parse_args()
    wks_segment.blender.register()
    learned, other = imported(options.learned), imported(options.other)
    settings = bpy.context.scene.wks_segment
    settings.source = "FRAMES"
    select(learned)
    assert bpy.ops.wks_segment.learn() == {"FINISHED"}
    select(other)
    assert bpy.ops.wks_segment.apply() == {"FINISHED"}
    scenes = [
        Scene("An animated character", learned, None, UNCOLORED),
        Scene("Its parts, the same in every pose", learned, labels_of(learned), COLORED),
        Scene("… and on another body", other, labels_of(other), OTHER),
    ]
    first, *others = [picture.quantize(N_COLORS, dither=Image.Dither.NONE) for picture in drawn(scenes)]
    first.save(
        options.output, save_all=True, append_images=others, duration=1000 // FRAMES_PER_SECOND, loop=0, optimize=True
    )
    print(f"{options.output}: {options.output.stat().st_size / 1e6:.2f} MB, {1 + len(others)} frames")


def imported(path: Path) -> Character:
    """The character of a file, with the walk as its only action."""
    before = set(bpy.data.objects), set(bpy.data.actions)
    bpy.ops.import_scene.gltf(filepath=str(path))
    objects = [obj for obj in bpy.data.objects if obj not in before[0]]
    actions = [action for action in bpy.data.actions if action not in before[1]]
    walk = min((action for action in actions if "walk" in action.name.lower()), key=lambda action: len(action.name))
    for rig in (obj for obj in objects if obj.type == "ARMATURE"):
        animation = rig.animation_data
        for track in list(animation.nla_tracks):
            animation.nla_tracks.remove(track)
        animation.action = walk
        if animation.action_slot is None:
            animation.action_slot = walk.slots[0]
        bpy.context.scene.frame_start, bpy.context.scene.frame_end = (round(frame) for frame in walk.frame_range)
    [character] = group([obj for obj in objects if obj.type == "MESH" and obj.visible_get()])
    return character


def select(character: Character) -> None:
    """Select the meshes of a character, and nothing else."""
    for obj in bpy.context.view_layer.objects:
        obj.select_set(obj in character.objects)
    bpy.context.view_layer.objects.active = character.objects[0]


def labels_of(character: Character) -> IntArray:
    """(p,) part of each polygon of a character."""
    return np.concatenate([labels_on(obj.data) for obj in character.objects])


def drawn(scenes: list[Scene]) -> Iterator[Image.Image]:
    """The frames of the scenes one after the other."""
    frame = 0
    for scene in scenes:
        place = placement(poses.read_pose(bpy.context, scene.character, "first").mesh.vertices)
        for _ in range(scene.n_frames):
            start, end = bpy.context.scene.frame_start, bpy.context.scene.frame_end
            bpy.context.scene.frame_set(start + round(frame * 24 / FRAMES_PER_SECOND) % max(end - start, 1))
            pose = poses.read_pose(bpy.context, scene.character, "frame")
            picture = without_overlay(pose, scene.labels, place)
            yield with_overlay(picture, scene, frame)
            frame += 1


def placement(points: FloatArray) -> FloatArray:
    """(4, 4) matrix from the world to the picture, in which the character has its usual size."""
    matrix = np.eye(4)
    matrix[:3, :3] = axes_of_view(VIEW_DIRECTION)
    turned = points @ matrix[:3, :3].T
    size = ROOM * np.ptp(turned[:, 0])
    matrix[:3] /= max(size, ROOM * np.ptp(turned[:, 1]) * SIZE[0] / SIZE[1])
    matrix[:3, 3] = -(points @ matrix[:3, :3].T).min(axis=0) / 2 - (points @ matrix[:3, :3].T).max(axis=0) / 2
    return matrix


def without_overlay(pose: poses.Pose, labels: IntArray | None, place: FloatArray) -> Image.Image:
    """A frame without caption, button and mouse."""
    colors = np.full((len(pose.mesh.faces), 3), GRAY)
    if labels is not None:
        colors = Style().colors_of(labels[pose.polygon_of])
    return rendered([(pose.mesh.vertices @ place[:3, :3].T + place[:3, 3], pose.mesh.faces, colors)], 1.0, SIZE)


def with_overlay(picture: Image.Image, scene: Scene, frame: int) -> Image.Image:
    """A frame with its caption, and with button and mouse until the click."""
    draw = ImageDraw.Draw(picture)
    draw.text((26, 22), scene.caption, TEXT, ImageFont.load_default(24))
    if scene.labels is None:
        draw.rounded_rectangle(BUTTON_BOX, 6, BUTTON_PRESSED if frame >= PRESSED else BUTTON)
        middle = ((BUTTON_BOX[0] + BUTTON_BOX[2]) / 2, (BUTTON_BOX[1] + BUTTON_BOX[3]) / 2)
        draw.text(middle, "Learn and Segment", (255, 255, 255), ImageFont.load_default(18), anchor="mm")
        way = max(1 - frame / (PRESSED - 3), 0) ** 2  # slower and slower
        tip = (170 + 260 * way, 312 - 150 * way)
        draw.polygon([(tip[0] + x, tip[1] + y) for x, y in CURSOR], (255, 255, 255), (0, 0, 0))
    return picture


if __name__ == "__main__":
    run(main)
