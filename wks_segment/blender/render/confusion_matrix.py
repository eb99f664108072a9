"""A picture of a confusion matrix: a row a class, a column what its queries were taken for."""

from __future__ import annotations

from math import pi
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix

from ...core import Retrieval
from .contact_sheet import add_text, paint, picture_scene, render

CELL = 72
"""Pixels of a cell."""
LETTERS, LETTER = 0.36, 0.17
"""Height of letters and about the width of one, in cells."""
MARGIN = 0.4
"""Around all, in cells."""
RIGHT, WRONG, NOTHING = (0.13, 0.42, 0.70), (0.80, 0.22, 0.16), (0.95, 0.95, 0.96)
"""sRGB of a cell that all queries of a class are in: on the diagonal, off it, and of one that none is in."""


def render_matrix(retrieval: Retrieval, path: Path) -> None:
    """Render the confusion matrix into a PNG file; UserError if it cannot be rendered or written."""
    names, counts = retrieval.names, retrieval.confusion
    words = f"{retrieval.right} of {retrieval.asked} right ({retrieval.rate:.1%})"
    note = "row: what it is, column: what it is taken for"
    label = LETTER * max(map(len, names)) + 0.2
    width = max(label + len(names), LETTER * max(len(words), len(note))) + 2 * MARGIN
    height = label + len(names) + 4 * LETTERS + 2 * MARGIN
    with picture_scene() as scene:
        for i, name in enumerate(names):
            _text(scene, name, -0.2, -i - 0.5 - LETTERS / 3, "RIGHT")
            _text(scene, name, i + 0.5 + LETTERS / 3, 0.2, "LEFT", turned=True)
            for j, count in enumerate(counts[i]):
                share = count / max(counts[i].sum(), 1)
                full = RIGHT if i == j else WRONG
                color = tuple(np.array(NOTHING) + share**0.5 * (np.array(full) - NOTHING))
                _cell(scene, j, -i, color)
                if count:
                    _text(scene, str(count), j + 0.5, -i - 0.5 - LETTERS / 3, "CENTER", light=share > 0.4)
        for i, line in enumerate((words, note)):
            _text(scene, line, -label, -len(names) - (1.6 + 1.5 * i) * LETTERS, "LEFT")
        camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
        camera.data.type = "ORTHO"
        camera.data.ortho_scale = max(width, height)
        camera.matrix_world = Matrix.Translation((width / 2 - label - MARGIN, label + MARGIN - height / 2, 10.0))
        scene.collection.objects.link(camera)
        scene.camera = camera
        scene.render.dither_intensity = 0.0  # flat colors, a small file
        render(scene, path, round(CELL * width), round(CELL * height), light="FLAT")


def _text(
    scene: bpy.types.Scene, text: str, x: float, y: float, align: str, turned: bool = False, light: bool = False
) -> None:
    letters = add_text(scene, text, LETTERS, align, (1.0, 1.0, 1.0) if light else (0.05, 0.05, 0.05))
    letters.location = (x, y, 1.0)
    letters.rotation_euler.z = pi / 2 if turned else 0.0


def _cell(scene: bpy.types.Scene, x: float, y: float, color: tuple[float, ...]) -> None:
    """A square to the right of and below a place, with a gap to the next."""
    near, far = 0.03, 0.97
    corners = [(x + near, y - near, 0), (x + near, y - far, 0), (x + far, y - far, 0), (x + far, y - near, 0)]
    mesh = bpy.data.meshes.new("cell")
    mesh.from_pydata(corners, [], [(0, 1, 2, 3)])
    paint(mesh, np.tile(color, (4, 1)))
    scene.collection.objects.link(bpy.data.objects.new("cell", mesh))
