"""Render the pictures of docs/parameters.md: one pose with different values of a setting.

    python -m scripts.parameter_pictures                         # all, to docs/images; takes some minutes
    python -m scripts.parameter_pictures smoothness loose_parts  # only these

Learns with the operators, as an artist does. Needs bpy and Pillow (`make` installs both in .venv).
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import bpy
import numpy as np
from mathutils import Matrix, Vector
from PIL import Image

import wks_segment.blender
from scripts._pictures import FOLDER, run
from wks_segment.blender.cli.demo_scene import creature_in
from wks_segment.blender.outputs.part_attributes import FACE_ATTRIBUTE
from wks_segment.blender.render.contact_sheet import Tile, render_poses
from wks_segment.blender.scene import poses
from wks_segment.blender.scene.characters import Character
from wks_segment.core.mesh.triangle_mesh import IntArray

TILE_WIDTH = 340
"""Width of a tile, in pixels."""
N_COLORS = 256
"""Number of colors in a picture; the eye sees no difference, and the file has a tenth of the bytes."""
MODEL_SETTINGS = ("n_segments", "n_eigenpairs", "preset", "pieces")
"""Settings that need a new model; the others take effect when a model is applied."""
FRAME = 8
"""Frame of the creature in the pictures."""
BEND = 0.6
"""Angle by which the robot bends its limbs in its second pose, in radians."""
Place = tuple[float, float, float]


class Sheet(NamedTuple):
    """Tiles side by side: caption and settings of each."""

    character: Callable[[], Character]
    tiles: dict[str, dict[str, Any]]


def creature() -> Character:
    """Build the creature of the demo."""
    character = creature_in(bpy.context.scene)
    settings = bpy.context.scene.wks_segment
    settings.source, settings.pose_count = "FRAMES", 4
    bpy.context.scene.frame_set(FRAME)
    return character


def robot() -> Character:
    """Build a robot of separate blocks, with two equal blocks in each limb."""
    blocks: list[tuple[Place, Place, Place | None]] = [  # middle, size, joint about which it is bent
        ((0.0, 0.0, 1.35), (0.56, 0.34, 0.7), None),
        ((0.0, 0.0, 1.92), (0.34, 0.34, 0.34), None),
    ]
    for side in (-1, 1):
        for x, top in ((0.42, 1.66), (0.16, 0.96)):
            end = (side * x, 0.0, top)
            blocks += [((side * x, 0.0, top - below), (0.18, 0.2, 0.34), end) for below in (0.2, 0.6)]
    vertices: list[Vector] = []
    bent: list[Vector] = []
    faces: list[list[int]] = []
    for i, (middle, size, joint) in enumerate(blocks):
        bpy.ops.mesh.primitive_cube_add(size=1.0)
        block = bpy.context.active_object
        rounded = block.modifiers.new("Bevel", "BEVEL")
        rounded.width, rounded.segments = 0.12, 2
        block.modifiers.new("Subdivision", "SUBSURF").levels = 1
        mesh = bpy.data.meshes.new_from_object(block.evaluated_get(bpy.context.evaluated_depsgraph_get()))
        bpy.data.objects.remove(block)
        place = Matrix.Translation(middle) @ Matrix.Diagonal((*size, 1.0))
        turn = Matrix()
        if joint is not None:
            turn = Matrix.Translation(joint) @ Matrix.Rotation(BEND * (-1) ** (i // 2), 4, "X")
            turn = turn @ Matrix.Translation(-Vector(joint))
        faces += [[corner + len(vertices) for corner in polygon.vertices] for polygon in mesh.polygons]
        own = [place @ vertex.co for vertex in mesh.vertices]
        vertices += own
        bent += [turn @ vertex for vertex in own]
    whole = bpy.data.meshes.new("Robot")
    whole.from_pydata(vertices, [], faces)
    obj = bpy.data.objects.new("Robot", whole)
    bpy.context.scene.collection.objects.link(obj)
    obj.shape_key_add(name="Basis")
    obj.shape_key_add(name="Walk").data.foreach_set("co", np.array(bent, dtype=np.float32).ravel())
    bpy.context.scene.wks_segment.source = "SHAPE_KEYS"
    return Character((obj,))


SHEETS = {
    "segments": Sheet(creature, {f"{count} segments": {"n_segments": count} for count in (4, 8, 12)}),
    "sides": Sheet(creature, {"One Part for Both": {}, "Left and Right": {"sides": "two"}}),
    "smoothness": Sheet(creature, {f"Smoothness {value}": {"smoothness": value} for value in (0, 1, 3)}),
    "smallest_part": Sheet(creature, {f"Smallest Part {share} %": {"min_share": share} for share in (0.5, 2, 6)}),
    "eigenpairs": Sheet(creature, {f"{count} eigenpairs": {"n_eigenpairs": count} for count in (30, 100, 300)}),
    "method": Sheet(creature, {"Robust": {}, "As in the Paper": {"preset": "paper"}}),
    "loose_parts": Sheet(
        robot,
        {
            "By the Whole Character": {"n_segments": 4},
            "Each on Its Own": {"n_segments": 4, "pieces": "separate"},
        },
    ),
}


def main() -> None:
    """Render the pictures that the options ask for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"pictures, by default all: {', '.join(SHEETS)}")
    parser.add_argument("--folder", type=Path, default=FOLDER)
    options = parser.parse_args()
    if unknown := set(options.names) - set(SHEETS):
        parser.error(f"there is no picture {', '.join(sorted(unknown))}")
    wks_segment.blender.register()
    models: dict[Any, str] = {}
    for name in options.names or SHEETS:
        path = options.folder / f"parameter_{name}.png"
        draw(SHEETS[name], path, models)
        print(f"{path}: {path.stat().st_size / 1000:.0f} kB", flush=True)


def draw(sheet: Sheet, path: Path, models: dict[Any, str]) -> None:
    """Render a sheet to a file; models that are learned for it are added to `models`."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    character = sheet.character()
    for obj in character.objects:
        obj.select_set(True)
        bpy.context.view_layer.objects.active = obj
    (pose,) = poses.read_objects(bpy.context, [character])
    tiles = [
        Tile(pose, labeled(character, changes, (sheet.character, models)), caption)
        for caption, changes in sheet.tiles.items()
    ]
    render_poses(tiles, path)
    with Image.open(path) as picture:
        small = picture.convert("RGB").resize((TILE_WIDTH * len(tiles), TILE_WIDTH), Image.Resampling.LANCZOS)
    reduced = small.quantize(N_COLORS, Image.Quantize.FASTOCTREE, kmeans=2, dither=Image.Dither.NONE)
    reduced.save(path, optimize=True)


def labeled(character: Character, changes: dict[str, Any], known: tuple[Any, dict[Any, str]]) -> IntArray:
    """(p,) part of each polygon, with the default settings except for some changes."""
    settings, (kind, models) = bpy.context.scene.wks_segment, known
    for name in {name for sheet in SHEETS.values() for values in sheet.tiles.values() for name in values}:
        settings.property_unset(name)
    for name, value in changes.items():
        setattr(settings, name, value)
    key = (kind, *(getattr(settings, name) for name in MODEL_SETTINGS))
    if key not in models:
        bpy.ops.wks_segment.learn()
        models[key] = settings.model
    settings.model = models[key]
    bpy.ops.wks_segment.apply()
    parts = []
    for obj in character.objects:
        labels = np.empty(len(obj.data.polygons), dtype=np.int32)
        obj.data.attributes[FACE_ATTRIBUTE].data.foreach_get("value", labels)
        parts.append(labels.astype(np.int64))
    return np.concatenate(parts)


if __name__ == "__main__":
    run(main)
