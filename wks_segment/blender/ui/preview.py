"""Preview: draws segments in the viewport that are not written to a mesh.

The arrays are made without a window; only drawing them needs one.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import bpy
import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader

from ...core.mesh.triangle_mesh import BoolArray, FloatArray, IntArray
from ..parts.palette import as_srgb, linear
from ..parts.part_style import PLAIN, Style
from ..scene import poses as reader
from ..scene.attributes import read_bools
from ..scene.characters import Character

SURFACE_OFFSET = 2e-3
"""Height of the preview above the surface as a share of the character's size. With less the surface shows through from
afar; with more the outline grows visibly."""
SHADES = (0.22, 0.7)
"""Linear light on faces edge-on to the light and facing it. In pictures of Blender's *Solid* shading, four fifths of a
creature have a light from 0.2 to 0.5; with these, and the light from the side, so has the preview."""
LIGHT_DIRECTION = np.array([0.3, -0.5, 0.8])
"""Direction to the light: from above, in front of a character that looks along -y, as in Blender's front view."""


def preview_triangles(
    context: bpy.types.Context, labels: Mapping[Character, IntArray], styles: Mapping[Character, Style]
) -> tuple[FloatArray, FloatArray]:
    """(3 t, 3) corners of the characters' triangles in their current pose, a little above them, and (3 t, 4) colors.

    The colors are sRGB, shaded in linear light as *Solid* shades the written ones.

    Parameters
    ----------
    context
    labels
        Part of each of a character's polygons.
    styles
        Colors of the parts of each character; the usual ones if it is missing.
    """
    from ...core.mesh.surface import indicator

    corners, colors = [np.zeros((0, 3))], [np.zeros((0, 4))]
    for character, parts in labels.items():
        pose = reader.read_pose(context, character, character.name)
        mesh, polygon_of = pose.mesh, pose.polygon_of
        labeled = np.flatnonzero((polygon_of >= 0) & (polygon_of < len(parts)))
        faces = mesh.faces[labeled]
        a, b, c = (mesh.vertices[faces[:, i]] for i in range(3))
        normals = np.cross(b - a, c - a)
        vertex_normals = _unit(indicator(faces.ravel(), mesh.n_vertices) @ np.repeat(normals, 3, axis=0))
        smooth = _smooth_polygons(character)[polygon_of[labeled]]
        corner_normals = np.where(smooth[:, None, None], vertex_normals[faces], _unit(normals)[:, None])
        size = float(np.ptp(mesh.vertices, axis=0).max())
        # Raised along vertex normals: along face normals gaps would open between faces.
        corners.append((mesh.vertices + SURFACE_OFFSET * size * vertex_normals)[faces].reshape(-1, 3))
        face_colors = styles.get(character, PLAIN).colors_of(parts[polygon_of[labeled]])
        corner_colors = np.ones((3 * len(labeled), 4))
        corner_colors[:, :3] = as_srgb(
            np.repeat(linear(face_colors), 3, axis=0) * _light_on(corner_normals.reshape(-1, 3))[:, None]
        )
        colors.append(corner_colors)
    return np.concatenate(corners), np.concatenate(colors)


class ViewportPreview:
    """Colored triangles that are drawn over all 3D viewports while they are shown."""

    def __init__(self) -> None:
        self.corners: FloatArray = np.zeros((0, 3))
        self.colors: FloatArray = np.zeros((0, 4))
        self._handle: Any = None
        self._batch: Any = None

    @property
    def shown(self) -> bool:
        """Whether triangles are shown."""
        return self._handle is not None

    def show(
        self, context: bpy.types.Context, labels: Mapping[Character, IntArray], styles: Mapping[Character, Style]
    ) -> None:
        """Show labels on the characters in their current pose; UserError if one cannot be read."""
        self.corners, self.colors = preview_triangles(context, labels, styles)
        self._batch = None
        if self._handle is None:
            self._handle = bpy.types.SpaceView3D.draw_handler_add(self._draw, (), "WINDOW", "POST_VIEW")
        _redraw(context)

    def hide(self) -> None:
        """Stop showing labels."""
        if self._handle is None:
            return
        bpy.types.SpaceView3D.draw_handler_remove(self._handle, "WINDOW")
        self._handle = self._batch = None
        self.corners, self.colors = np.zeros((0, 3)), np.zeros((0, 4))
        _redraw(bpy.context)

    def _draw(self) -> None:
        """Called by Blender to draw each viewport."""
        shader = gpu.shader.from_builtin("SMOOTH_COLOR")
        if self._batch is None:
            content = {"pos": self.corners.astype(np.float32), "color": self.colors.astype(np.float32)}
            self._batch = batch_for_shader(shader, "TRIS", content)
        gpu.state.depth_test_set("LESS_EQUAL")
        gpu.state.depth_mask_set(True)
        self._batch.draw(shader)
        gpu.state.depth_mask_set(False)
        gpu.state.depth_test_set("NONE")


def _light_on(normals: FloatArray) -> FloatArray:
    """(n,) linear light on surfaces with (n, 3) unit normals. Both sides are lit, since faces may be flipped."""
    darkest, brightest = SHADES
    toward = np.abs(normals @ (LIGHT_DIRECTION / np.linalg.norm(LIGHT_DIRECTION)))
    return np.asarray(darkest + (brightest - darkest) * toward)


def _smooth_polygons(character: Character) -> BoolArray:
    """(p,) whether each of a character's polygons is shaded smooth."""
    return np.concatenate([read_bools(obj.data.polygons, "use_smooth") for obj in character.objects])


def _unit(vectors: FloatArray) -> FloatArray:
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), np.finfo(float).tiny))


def _redraw(context: bpy.types.Context) -> None:
    """Redraw all 3D viewports."""
    for window in context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                area.tag_redraw()
