"""Opens and saves files in the formats of Blender's own importers and exporters."""

from __future__ import annotations

import os
import re
import shutil
import tempfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import bpy

from ...core.files.whole_file import incomplete, no_space, whole_file
from ...core.message import Message, message_of
from ..errors import UserError
from ..streams import silent
from .complete_files import check_complete, check_obj
from .file_content import check_content
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
TRACEBACK = "Traceback (most recent call last):"
READ_NAME, WRITTEN_NAME, PATH_BYTES = 255, 230, 1000
"""Most bytes of the name of a file that is read, of one that is written, and of a whole path. File systems take 255
bytes and Blender 1023, and a name gets a suffix while its file is written."""
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
        check_length(path, READ_NAME)
        if not path.is_file():
            raise UserError("{path}: there is no such file", path=path)
        if path.suffix.lower() not in IMPORTERS:
            raise UserError(
                "{path}: unknown format; save it as .glb, .fbx or .blend in the program that made it, or in one that "
                "opens it. Known are {formats}",
                path=path, formats=", ".join(IMPORTERS),
            )  # fmt: skip
        check_content(path)
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
    objects = [obj for obj in bpy.data.objects if obj not in before]
    if not objects:  # some importers only print what is wrong
        raise UserError(
            "{path}: there is no mesh in this file: Blender's importer found nothing in it, so it is empty or damaged",
            path=path,
        )
    return objects


def _try(reader: Callable[[str], object], path: Path) -> None:
    try:
        with silent():
            reader(str(path.resolve()))
    except (RuntimeError, OSError) as error:
        raise UserError("{path}: Blender cannot read it: {reason}", path=path, reason=_reason(str(error))) from error
    except AttributeError as error:
        if "could not be found" not in str(error):
            raise
        raise UserError(
            "{path}: Blender's importer of {suffix} files is turned off or missing in this Blender: enable its add-on",
            path=path, suffix=path.suffix.lower(),
        ) from error  # fmt: skip


def _reason(text: str) -> Message:
    """The error of an operator in one line, without what Blender puts before it.

    An importer that is written in Python fails with the whole traceback, of which the last line says what is wrong.
    """
    if TRACEBACK not in text:
        lines = (line.strip().removeprefix("Error: ") for line in text.splitlines())
        return Message("{text}", text="; ".join(line.rstrip(".") for line in lines if line))
    raised = re.findall(r"^[A-Za-z_][\w.]*(?:: .*)?$", text.partition(TRACEBACK)[2], re.MULTILINE)
    raised = [line for line in raised if not line.startswith("Location:")]
    if any(line.startswith("RecursionError") for line in raised):
        return Message("its parts contain each other in a circle, or are nested too deeply")
    return Message(
        "its importer failed ({error}), so it is damaged or of a kind that the importer does not know",
        error=raised[-1] if raised else "?",
    )


def check_output(path: Path) -> None:
    """UserError unless a scene can be written to a path; called before a long computation."""
    if path.suffix.lower() not in EXPORTERS:
        raise UserError("{path}: unknown format to write; known are {formats}", path=path, formats=", ".join(EXPORTERS))
    check_folder(path)


def check_length(path: Path, most: int) -> None:
    """UserError if the file system or Blender cannot take a path, because it or the name of its file is too long."""
    if len(os.fsencode(path.name)) > most or len(os.fsencode(path.resolve())) > PATH_BYTES:
        raise UserError(
            "{path} …: the name is too long: take at most {name} bytes, and {whole} with all folders",
            path=str(path)[:80], name=most, whole=PATH_BYTES,
        )  # fmt: skip


def check_folder(path: Path) -> None:
    """UserError unless a file can be written to a path: into its folder, and with a name that is not too long."""
    check_length(path, WRITTEN_NAME)
    folder = path.resolve().parent
    if not folder.is_dir():
        raise UserError("{path}: the folder {folder} does not exist", path=path, folder=folder)
    if not os.access(folder, os.W_OK):
        raise UserError(
            "{path}: the folder {folder} is not writable: take another one, or ask whom it belongs to",
            path=path, folder=folder,
        )  # fmt: skip
    if path.is_dir():
        raise UserError("{path}: this is a folder, give the name of a file", path=path)


def save_scene(path: Path, first: Path | None = None) -> None:
    """Write the scene to a file, which appears whole.

    Parameters
    ----------
    path : path
    first : path, optional
        Where the file is written before it is moved to `path`, without its suffix. Blender stores where images,
        libraries and caches are relative to the folder in which it writes.

    Raises
    ------
    UserError
        If the file cannot be written.
    """
    suffix = path.suffix.lower()
    try:
        if suffix == ".obj":
            _save_obj(path, first)
        else:
            with whole_file(path, check_complete, first=first) as unfinished:
                _export(unfinished)
    except OSError as error:
        raise not_written(path, error) from error


def _export(path: Path) -> None:
    try:
        with silent():
            EXPORTERS[path.suffix.lower()](str(path))
    except RuntimeError as error:
        if path.suffix.lower() == ".blend" and not path.exists() and _is_larger_than_space(path.parent):
            raise no_space(path) from error
        raise incomplete(path, _reason(str(error))) from error


def _is_larger_than_space(folder: Path) -> bool:
    """Whether the scene does not fit on the disk of a folder.

    Blender before 5.0 removes the piece that it has written to a full disk, and says that the file does not exist.
    """
    with tempfile.TemporaryDirectory() as elsewhere, suppress(RuntimeError):
        copy = Path(elsewhere) / "scene.blend"
        EXPORTERS[".blend"](str(copy))
        return copy.stat().st_size > shutil.disk_usage(folder).free
    return False


def _save_obj(path: Path, first: Path | None) -> None:
    """Write the scene to an .obj file, and its materials to an .mtl file beside it; see `save_scene`."""
    objects = bpy.context.evaluated_depsgraph_get().objects
    n_faces = sum(len(obj.data.polygons) for obj in objects if obj.type == "MESH")
    with whole_file(path, lambda written: check_obj(written, n_faces), [".mtl"], first) as unfinished:
        _export(unfinished)
        # It speaks of its materials by the name that their file has for now.
        library, final = (b"mtllib " + os.fsencode(name) + b".mtl\n" for name in (unfinished.stem, path.stem))
        unfinished.write_bytes(unfinished.read_bytes().replace(library, final, 1))


def not_written(path: Path, error: OSError) -> UserError:
    """The error of a file that could not be written."""
    return UserError("{path}: it could not be written: {reason}", path=path, reason=error.strerror or message_of(error))
