"""Reads files in the Object File Format (.off), for which Blender has no importer."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import bpy

from ..errors import UserError
from .file_content import name_of

HEADER = re.compile(r"(ST)?C?N?OFF\b")
"""First word of a file in plain text, perhaps with coordinates of textures, colors or normals at each vertex."""


def import_off(path: str) -> None:
    """Add an object with the mesh in a file to the scene; the colors in it are ignored.

    Raises
    ------
    UserError
        If the file is no OFF file in plain text, or is damaged.
    """
    file = Path(path)
    lines = _lines(file)
    number, first = next(lines, (1, ""))
    header = HEADER.match(first)
    if header is None or "BINARY" in first:
        raise UserError('{path}: this is no OFF file in plain text: it does not begin with "OFF"', path=file.name)
    try:
        rest = first[header.end() :].split()
        if not rest:
            number, text = next(lines)
            rest = text.split()
        n_vertices, n_faces = int(rest[0]), int(rest[1])
        vertices = []
        for _ in range(n_vertices):
            number, text = next(lines)
            x, y, z = map(float, text.split()[:3])
            vertices.append((x, y, z))
        faces = []
        for _ in range(n_faces):
            number, text = next(lines)
            words = text.split()
            corners = [int(word) for word in words[1 : 1 + int(words[0])]]
            if len(corners) != int(words[0]) or not all(0 <= corner < n_vertices for corner in corners):
                raise ValueError
            faces.append(corners)
    except StopIteration:
        raise UserError("{path}: the file ends before all vertices and faces: copy it again", path=file.name) from None
    except (ValueError, IndexError):
        raise UserError("{path}: line {line} is no line of an OFF file", path=file.name, line=number) from None
    mesh = bpy.data.meshes.new(name_of(file))
    mesh.from_pydata(vertices, [], [corners for corners in faces if len(corners) > 2])
    bpy.context.scene.collection.objects.link(bpy.data.objects.new(name_of(file), mesh))


def _lines(file: Path) -> Iterator[tuple[int, str]]:
    """Number and text of each line that is not empty, without comments."""
    with file.open(encoding="utf-8", errors="replace") as stream:
        for number, line in enumerate(stream, 1):
            text = line.partition("#")[0].strip()
            if text:
                yield number, text
