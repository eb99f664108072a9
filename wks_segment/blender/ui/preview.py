"""Shows segments in the viewport that are not written to any mesh: arrays, which only drawing needs a window for."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import bpy
import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader

from ...core.mesh.surface import indicator
from ...core.mesh.triangle_mesh import FloatArray, IntArray
from ..parts.part_style import PLAIN, Style
from ..scene import poses as reader
from ..scene.characters import Character

OFFSET = 2e-3
"""By how much the picture lies above the surface, as a share of the character's size."""
DARKEST = 0.55
"""Brightness of what is seen edge-on to the light."""
LIGHT = np.array([0.3, -0.5, 0.8])
"""From where the light comes, over the left shoulder of who looks along y."""


def picture(
    context: bpy.types.Context, labels: Mapping[Character, IntArray], style: Style = PLAIN
) -> tuple[FloatArray, FloatArray]:
    """(3 t, 3) corners of the triangles of characters as they are seen now, a little above them, and (3 t, 4) colors.

    Parameters
    ----------
    context
    labels
        Part of each of a character's polygons.
    style : Style, optional
        Colors of parts.
    """
    places, colors = [np.zeros((0, 3))], [np.zeros((0, 4))]
    for character, parts in labels.items():
        pose = reader.read_pose(context, character, character.name)
        mesh, polygon_of = pose.mesh, pose.polygon_of
        known = np.flatnonzero((polygon_of >= 0) & (polygon_of < len(parts)))
        faces = mesh.faces[known]
        a, b, c = (mesh.vertices[faces[:, i]] for i in range(3))
        normals = np.cross(b - a, c - a)
        at_vertices = indicator(faces.ravel(), mesh.n_vertices) @ np.repeat(normals, 3, axis=0)
        # Both sides are lit, since faces may be turned inside out.
        shade = DARKEST + (1 - DARKEST) * np.abs(_unit(normals) @ (LIGHT / np.linalg.norm(LIGHT)))
        size = float(np.ptp(mesh.vertices, axis=0).max())
        # Along the normals of vertices, or gaps would open between faces.
        places.append((mesh.vertices + OFFSET * size * _unit(at_vertices))[faces].reshape(-1, 3))
        of_faces = np.ones((len(known), 4))
        of_faces[:, :3] = style.colors_of(parts[polygon_of[known]]) * shade[:, None]
        colors.append(np.repeat(of_faces, 3, axis=0))
    return np.concatenate(places), np.concatenate(colors)


class Preview:
    """The picture that is drawn over all 3D viewports, if there is one."""

    def __init__(self) -> None:
        self.places: FloatArray = np.zeros((0, 3))
        self.colors: FloatArray = np.zeros((0, 4))
        self._handle: Any = None
        self._batch: Any = None

    @property
    def shown(self) -> bool:
        """Whether there is one."""
        return self._handle is not None

    def show(self, context: bpy.types.Context, labels: Mapping[Character, IntArray], style: Style) -> None:
        """Draw these labels from now on, on the characters as they are seen now; UserError if one cannot be read."""
        self.places, self.colors = picture(context, labels, style)
        self._batch = None
        if self._handle is None:
            self._handle = bpy.types.SpaceView3D.draw_handler_add(self._draw, (), "WINDOW", "POST_VIEW")
        _redraw(context)

    def hide(self) -> None:
        """Draw nothing any more."""
        if self._handle is None:
            return
        bpy.types.SpaceView3D.draw_handler_remove(self._handle, "WINDOW")
        self._handle = self._batch = None
        self.places, self.colors = np.zeros((0, 3)), np.zeros((0, 4))
        _redraw(bpy.context)

    def _draw(self) -> None:
        """Called by Blender for each viewport."""
        shader = gpu.shader.from_builtin("SMOOTH_COLOR")
        if self._batch is None:
            content = {"pos": self.places.astype(np.float32), "color": self.colors.astype(np.float32)}
            self._batch = batch_for_shader(shader, "TRIS", content)
        gpu.state.depth_test_set("LESS_EQUAL")
        gpu.state.depth_mask_set(True)
        self._batch.draw(shader)
        gpu.state.depth_mask_set(False)
        gpu.state.depth_test_set("NONE")


def _unit(vectors: FloatArray) -> FloatArray:
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), np.finfo(float).tiny))


def _redraw(context: bpy.types.Context) -> None:
    """Draw all 3D viewports anew."""
    for window in context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                area.tag_redraw()
