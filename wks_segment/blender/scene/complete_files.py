"""Whether a file that Blender wrote is complete: it says nothing if the disk was full."""

from __future__ import annotations

import json
import os
import struct
import zlib
from pathlib import Path

from ...core.files.whole_file import incomplete

ZSTANDARD = b"\x28\xb5\x2f\xfd"
"""Beginning of a compressed .blend file."""
SEEK_TABLE = struct.Struct("<IBI")
"""End of a compressed .blend file: how many frames there are, flags, and a signature."""
SEEK_TABLE_SIGNATURE = 0x8F92EAB1
PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"


def check_complete(path: Path) -> None:
    """OSError if a .blend, .glb or .png file ends too early, or a piece of it is missing."""
    checks = {".blend": _is_blend, ".glb": _is_glb, ".png": _is_png}
    try:
        whole = checks[path.suffix.lower()](path)
    except (struct.error, ValueError, KeyError, IndexError):  # it ends within a number, or is no JSON
        whole = False
    if not whole:
        raise incomplete(path)


def check_obj(path: Path, n_faces: int) -> None:
    """OSError if an .obj file has fewer faces than the scene, or materials that the .mtl file beside it has not."""
    found, used, last = 0, set(), b""
    with path.open("rb") as file:
        for last in file:
            found += last.startswith(b"f ")
            if last.startswith(b"usemtl "):
                used.add(last.removeprefix(b"usemtl "))
    if not last.endswith(b"\n") or found < n_faces:
        raise incomplete(path)
    library = path.with_suffix(".mtl")
    lines = library.read_bytes().splitlines(keepends=True) if library.exists() else []
    if used - {line.removeprefix(b"newmtl ") for line in lines} or (lines and not lines[-1].endswith(b"\n")):
        raise incomplete(path)


def _is_blend(path: Path) -> bool:
    """Whether the blocks of a .blend file, or its compressed frames, follow each other up to its end."""
    size = path.stat().st_size
    with path.open("rb") as file:
        start = file.read(17)
        if start.startswith(ZSTANDARD):
            file.seek(-SEEK_TABLE.size, os.SEEK_END)
            n_frames, flags, signature = SEEK_TABLE.unpack(file.read(SEEK_TABLE.size))
            n_bytes = n_frames * (12 if flags & 0x80 else 8)
            if signature != SEEK_TABLE_SIGNATURE or n_bytes > size:
                return False
            file.seek(-SEEK_TABLE.size - n_bytes, os.SEEK_END)
            entries = struct.unpack(f"<{n_bytes // 4}I", file.read(n_bytes))
            frames = sum(entries[:: 3 if flags & 0x80 else 2])
            return frames + 8 + n_bytes + SEEK_TABLE.size == size  # 8: header of the table
        if not start.startswith(b"BLENDER"):
            return False
        # Since 5.0 a header says its own size, and blocks can be larger than 2 GB.
        is_new = start[7:9].isdigit()
        place = int(start[7:9]) if is_new else 12
        block = struct.Struct("<4siQqq") if is_new else struct.Struct("<4siQii")
        while True:
            file.seek(place)
            code, *numbers = block.unpack(file.read(block.size))
            place += block.size + (numbers[2] if is_new else numbers[0])
            if code == b"ENDB" or place > size:
                return place == size


def _is_glb(path: Path) -> bool:
    """Whether the chunks of a binary glTF file fill it, and the second has the bytes that the first one speaks of."""
    data = path.read_bytes()
    name, _, size, length, kind = struct.unpack_from("<4s4I", data)
    if name != b"glTF" or kind != 0x4E4F534A or size != len(data):
        return False
    buffers = json.loads(data[20 : 20 + length]).get("buffers", [])
    rest = len(data) - 20 - length
    if not buffers:
        return rest == 0
    (n_bytes,) = struct.unpack_from("<I", data, 20 + length)
    return rest == 8 + n_bytes and buffers[0]["byteLength"] <= n_bytes


def _is_png(path: Path) -> bool:
    """Whether all chunks of a PNG file have their checksum, up to the last one."""
    data = path.read_bytes()
    place, name = len(PNG_SIGNATURE), b""
    if not data.startswith(PNG_SIGNATURE):
        return False
    while name != b"IEND":
        length, name = struct.unpack_from(">I4s", data, place)
        (checksum,) = struct.unpack_from(">I", data, place + 8 + length)
        if zlib.crc32(data[place + 4 : place + 8 + length]) != checksum:
            return False
        place += 12 + length
    return place == len(data)
