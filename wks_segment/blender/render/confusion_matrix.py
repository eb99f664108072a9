"""Render a confusion matrix: a row for each class, a column for the class that its queries were taken for."""

from __future__ import annotations

from math import pi
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix

from ... import core
from .contact_sheet import add_text, paint, picture_scene, render, width_of

CELL_PIXELS = 72
"""Width and height of a cell, in pixels."""
TEXT_HEIGHT, CELL_TEXT_WIDTH, NAME_WIDTH, LINE_WIDTH = 0.36, 0.85, 6.0, 30.0
"""Height of text, and the largest widths of a number, of a name and of a line below the matrix, in cells."""
MATRIX_MARGIN = 0.4
"""Width of the margin around the matrix, in cells."""
RIGHT_COLOR, WRONG_COLOR, EMPTY_COLOR = (0.13, 0.42, 0.70), (0.80, 0.22, 0.16), (0.95, 0.95, 0.96)
"""sRGB of a cell with all queries of its class, on the diagonal and off it, and of a cell without queries."""


def render_matrix(retrieval: core.Retrieval, path: Path) -> None:
    """Render the confusion matrix to a PNG file; UserError if it cannot be rendered or written."""
    names, counts = retrieval.names, retrieval.confusion
    summary = f"{retrieval.right} of {retrieval.asked} right ({retrieval.rate:.1%})"
    legend = "row: class, column: class that it is taken for"
    with picture_scene() as scene:
        widths = [0.0]
        for i, name in enumerate(names):
            row = _text(scene, name, (-0.2, -i - 0.5 - TEXT_HEIGHT / 3), "RIGHT", NAME_WIDTH)
            _text(scene, name, (i + 0.5 + TEXT_HEIGHT / 3, 0.2), "LEFT", NAME_WIDTH, vertical=True)
            widths.append(width_of(row.data))
            for j, count in enumerate(counts[i]):
                share = count / max(counts[i].sum(), 1)
                full_color = RIGHT_COLOR if i == j else WRONG_COLOR
                color = tuple(np.array(EMPTY_COLOR) + share**0.5 * (np.array(full_color) - EMPTY_COLOR))
                _cell(scene, j, -i, color)
                if count:
                    place = j + 0.5, -i - 0.5 - TEXT_HEIGHT / 3
                    _text(scene, str(count), place, "CENTER", CELL_TEXT_WIDTH, light=share > 0.4)
        label = max(widths) + 0.4
        lines = [
            _text(scene, line, (-label, -len(names) - (1.6 + 1.5 * i) * TEXT_HEIGHT), "LEFT", LINE_WIDTH)
            for i, line in enumerate((summary, legend))
        ]
        width = max(label + len(names), *(width_of(line.data) for line in lines)) + 2 * MATRIX_MARGIN
        height = label + len(names) + 4 * TEXT_HEIGHT + 2 * MATRIX_MARGIN
        camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
        camera.data.type = "ORTHO"
        camera.data.ortho_scale = max(width, height)
        camera.matrix_world = Matrix.Translation(
            (width / 2 - label - MATRIX_MARGIN, label + MATRIX_MARGIN - height / 2, 10.0)
        )
        scene.collection.objects.link(camera)
        scene.camera = camera
        scene.render.dither_intensity = 0.0  # flat colors, a small file
        render(scene, path, round(CELL_PIXELS * width), round(CELL_PIXELS * height), light="FLAT")


def _text(
    scene: bpy.types.Scene, text: str, place: tuple[float, float], align: str, width: float,
    vertical: bool = False, light: bool = False,
) -> bpy.types.Object:  # fmt: skip
    """Add text at a place, from left to right or, if vertical, upwards."""
    letters = add_text(scene, text, TEXT_HEIGHT, width, align, (1.0, 1.0, 1.0) if light else (0.05, 0.05, 0.05))
    letters.location = (*place, 1.0)
    letters.rotation_euler.z = pi / 2 if vertical else 0.0
    return letters


def _cell(scene: bpy.types.Scene, x: float, y: float, color: tuple[float, ...]) -> None:
    """Add a square with its upper left corner at (x, y), and a gap to its neighbors."""
    near, far = 0.03, 0.97
    corners = [(x + near, y - near, 0), (x + near, y - far, 0), (x + far, y - far, 0), (x + far, y - near, 0)]
    mesh = bpy.data.meshes.new("cell")
    mesh.from_pydata(corners, [], [(0, 1, 2, 3)])
    paint(mesh, np.tile(color, (4, 1)))
    scene.collection.objects.link(bpy.data.objects.new("cell", mesh))
