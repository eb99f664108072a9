"""Opens and saves files in the formats of Blender's own importers and exporters."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import bpy

from ..errors import UserError
from .off_files import import_off


def _import_fbx(path: str) -> None:
    if "fbx_import" in dir(bpy.ops.wm):  # since 4.5; hasattr is true for any name
        bpy.ops.wm.fbx_import(filepath=path)
    else:
        bpy.ops.import_scene.fbx(filepath=path)


def _append_blend(path: str) -> None:
    """Append all objects of a .blend file, linked into the scene."""
    with bpy.data.libraries.load(path) as (source, target):
        target.objects = source.objects
    for obj in target.objects:
        if obj is not None:
            bpy.context.scene.collection.objects.link(obj)


IMPORTERS: dict[str, Callable[[str], object]] = {
    ".blend": _append_blend,
    ".glb": lambda path: bpy.ops.import_scene.gltf(filepath=path),
    ".gltf": lambda path: bpy.ops.import_scene.gltf(filepath=path),
    ".vrm": lambda path: bpy.ops.import_scene.gltf(filepath=path),
    ".obj": lambda path: bpy.ops.wm.obj_import(filepath=path),
    ".ply": lambda path: bpy.ops.wm.ply_import(filepath=path),
    ".stl": lambda path: bpy.ops.wm.stl_import(filepath=path),
    ".off": import_off,
    ".fbx": _import_fbx,
    ".abc": lambda path: bpy.ops.wm.alembic_import(filepath=path, as_background_job=False),
    ".usd": lambda path: bpy.ops.wm.usd_import(filepath=path),
    ".usdc": lambda path: bpy.ops.wm.usd_import(filepath=path),
    ".usda": lambda path: bpy.ops.wm.usd_import(filepath=path),
    ".usdz": lambda path: bpy.ops.wm.usd_import(filepath=path),
}
EXPORTERS: dict[str, Callable[[str], object]] = {
    ".blend": lambda path: bpy.ops.wm.save_as_mainfile(filepath=path, copy=True),
    ".glb": lambda path: bpy.ops.export_scene.gltf(filepath=path, export_vertex_color="ACTIVE"),
    ".obj": lambda path: bpy.ops.wm.obj_export(filepath=path, export_colors=True),
}


def open_files(paths: list[Path]) -> list[list[bpy.types.Object]]:
    """Read files into an empty scene; gives the objects from each file.

    A single .blend file is opened with all that it contains, so that nothing is missing when it is saved later.

    Raises
    ------
    UserError
        If a file does not exist, is of no known format, or cannot be read.
    """
    for path in paths:
        if not path.is_file():
            raise UserError("{path}: there is no such file", path=path)
        if path.suffix.lower() not in IMPORTERS:
            raise UserError(
                "{path}: unknown format; save it as .glb, .fbx or .blend in the program that made it, or in one that "
                "opens it. Known are {formats}",
                path=path, formats=", ".join(IMPORTERS),
            )  # fmt: skip
    if len(paths) == 1 and paths[0].suffix.lower() == ".blend":
        _try(lambda path: bpy.ops.wm.open_mainfile(filepath=path, load_ui=False), paths[0])
        if bpy.context.object is not None and bpy.context.object.mode != "OBJECT":
            bpy.ops.object.mode_set(mode="OBJECT")
        return [list(bpy.context.scene.objects)]
    # Not read_factory_settings: that would disable this extension.
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    return [_import(path) for path in paths]


def _import(path: Path) -> list[bpy.types.Object]:
    before = set(bpy.data.objects)
    _try(IMPORTERS[path.suffix.lower()], path)
    bpy.context.view_layer.update()
    return [obj for obj in bpy.data.objects if obj not in before]


def _try(reader: Callable[[str], object], path: Path) -> None:
    try:
        reader(str(path.resolve()))
    except (RuntimeError, OSError) as error:
        raise UserError("{path}: Blender cannot read it: {reason}", path=path, reason=str(error).strip()) from error


def check_output(path: Path) -> None:
    """UserError unless a scene can be written to a path; called before a long computation."""
    if path.suffix.lower() not in EXPORTERS:
        raise UserError("{path}: unknown format to write; known are {formats}", path=path, formats=", ".join(EXPORTERS))
    check_folder(path)


def check_folder(path: Path) -> None:
    """UserError unless the folder of a file exists."""
    if not path.resolve().parent.is_dir():
        raise UserError("{path}: the folder {folder} does not exist", path=path, folder=path.resolve().parent)
    if path.is_dir():
        raise UserError("{path}: this is a folder, give the name of a file", path=path)


def save_scene(path: Path) -> None:
    """Write the scene to a file; UserError if it cannot be written."""
    try:
        EXPORTERS[path.suffix.lower()](str(path.resolve()))
    except (RuntimeError, OSError) as error:
        raise UserError("{path}: it could not be written: {reason}", path=path, reason=str(error).strip()) from error
    if not path.is_file():
        raise UserError("{path}: it could not be written", path=path)
