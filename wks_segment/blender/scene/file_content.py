"""What a file is by its content, whatever its name says: Blender's importers say little about other files."""

from __future__ import annotations

import json
import os
import struct
from contextlib import suppress
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from typing import Any
from urllib.parse import unquote

from ..errors import UserError

HEAD = 512
"""Bytes at the beginning of a file that are looked at: more than all signatures, and than a pointer to another file."""
SIGNATURES = {
    ".blend": (b"BLENDER", b"\x1f\x8b", b"\x28\xb5\x2f\xfd"),  # as it is, or compressed by gzip or Zstandard
    ".glb": (b"glTF", b"{"),
    ".gltf": (b"glTF", b"{"),
    ".vrm": (b"glTF", b"{"),
    ".ply": (b"ply",),
    ".abc": (b"Ogawa", b"\x89HDF"),
    ".usdc": (b"PXR-USDC",),
    ".usda": (b"#usda",),
    ".usdz": (b"PK\x03\x04",),
}
"""How files of a format begin. A suffix that is not here has no signature, or several that importers read."""
GLTF = (".glb", ".gltf", ".vrm")
ARCHIVES = (b"PK\x03\x04", b"\x1f\x8b", b"7z\xbc\xaf\x27\x1c", b"Rar!", b"BZh", b"\xfd7zXZ")
"""How archives begin."""
CHUNK_HEADER = struct.Struct("<4s4I")
"""Beginning of a binary glTF file: its name, version and size, and the size and kind of the first chunk."""
POINTERS = {b"version https://git-lfs": ("Git LFS", "git lfs pull"), b"/annex/objects/": ("git-annex", "git annex get")}
"""How files begin that stand for a large file of a repository; what made them, and the command that gets the file."""


def name_of(path: Path) -> str:
    """Name of a file without its suffix, for data-blocks and texts in Blender, which holds UTF-8 only."""
    return os.fsencode(path.stem).decode(errors="replace")


def check_content(path: Path) -> None:
    """UserError if a file cannot be what its suffix says, or a part of it is missing; says what it is instead."""
    head = _check_whole(path)
    suffix = path.suffix.lower()
    signatures = SIGNATURES.get(suffix, ())
    if head.startswith(b"<"):
        raise UserError(
            "{path}: it is a web page or another text in tags, not a 3D file: download the file itself", path=path
        )
    if head.startswith(ARCHIVES) and not head.startswith(signatures or b"\0"):
        raise UserError("{path}: it is an archive: unpack it first", path=path)
    if signatures and not head.startswith(signatures):
        raise UserError(
            "{path}: it is no {suffix} file, whatever its name says: export or download it again",
            path=path, suffix=suffix,
        )  # fmt: skip
    if suffix in GLTF:
        _check_gltf(path, _gltf_content(path))


def _check_whole(path: Path) -> bytes:
    """The beginning of a file, without a byte order mark and white space; UserError if there is no content in it."""
    with path.open("rb") as file:
        head = file.read(HEAD).removeprefix(b"\xef\xbb\xbf").lstrip()
    if not head:
        raise UserError("{path}: the file is empty: export or download it again", path=path)
    for beginning, (maker, command) in POINTERS.items():
        if head.startswith(beginning):
            raise UserError(
                '{path}: it is only a pointer of {maker} to the file: get the file itself with "{command}"',
                path=path, maker=maker, command=command,
            )  # fmt: skip
    return head


def _check_gltf(path: Path, content: Any) -> None:
    """UserError if a file that a glTF file keeps its numbers in is not there, or if its nodes contain each other."""
    try:
        buffers = [str(buffer["uri"]) for buffer in content.get("buffers", ()) if "uri" in buffer]
        children = {i: node.get("children", ()) for i, node in enumerate(content.get("nodes", ()))}
        TopologicalSorter(children).prepare()
    except CycleError as error:
        circle = ", ".join(map(str, error.args[1]))
        raise UserError("{path}: its nodes contain each other in a circle: {nodes}", path=path, nodes=circle) from error
    except (AttributeError, TypeError):
        return  # the importer says what is wrong with it
    for uri in buffers:
        if uri.startswith("data:"):
            continue
        part = path.parent / unquote(uri)
        if not part.is_file():
            raise UserError("{path}: a file that it needs is missing: {part}", path=path, part=part)
        _check_whole(part)


def _gltf_content(path: Path) -> Any:
    """The description in a glTF file, which is the whole file or its first chunk; None if it cannot be read."""
    with path.open("rb") as file, suppress(ValueError, struct.error, RecursionError):
        header = file.read(CHUNK_HEADER.size)
        if header.startswith(b"glTF"):
            return json.loads(file.read(CHUNK_HEADER.unpack(header)[3]))
        return json.loads(header + file.read())
    return None
