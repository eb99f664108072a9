"""What the scripts that make pictures of the docs share: the folder, the scene of a picture, and their end."""

from __future__ import annotations

import os
import sys
import tempfile
import traceback
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NoReturn

import bpy
import numpy as np
from mathutils import Matrix, Vector
from PIL import Image

from wks_segment.blender.render.contact_sheet import paint, picture_scene, render
from wks_segment.core.mesh.triangle_mesh import FloatArray, IntArray

FOLDER = Path(__file__).resolve().parent.parent / "docs" / "images"
Body = tuple[FloatArray, IntArray, FloatArray]
"""(n, 3) vertices as the camera sees them, (m, 3) faces, and colors: (n, 3) of vertices or (m, 3) of faces."""


def axes_of_view(direction: Vector) -> FloatArray:
    """(3, 3) right, up, and toward a camera that looks from a direction."""
    toward = direction.normalized()
    right = Vector((0, 0, 1)).cross(toward).normalized()
    return np.array([right, toward.cross(right), toward])


def rendered(bodies: Sequence[Body], width: float, size: tuple[int, int], smooth: bool = False) -> Image.Image:
    """A picture of bodies around the origin: `width` units wide, `size` pixels."""
    with picture_scene() as scene, tempfile.TemporaryDirectory() as folder:
        for points, faces, colors in bodies:
            mesh = bpy.data.meshes.new("body")
            mesh.from_pydata(points.tolist(), [], faces.tolist())
            if smooth:
                mesh.shade_smooth()
            paint(mesh, colors[faces.ravel()] if len(colors) == len(points) else np.repeat(colors, 3, axis=0))
            scene.collection.objects.link(bpy.data.objects.new("body", mesh))
        camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
        camera.data.type, camera.data.ortho_scale = "ORTHO", width
        camera.matrix_world = Matrix.Translation((0, 0, 10))
        scene.collection.objects.link(camera)
        scene.camera = camera
        path = Path(folder, "picture.png")
        render(scene, path, *size)
        with Image.open(path) as picture:
            return picture.convert("RGB")


def run(main: Callable[[], None]) -> NoReturn:
    """Run a script and end its process, since bpy may hang or crash at a normal exit."""
    code = 1
    try:
        main()
        code = 0
    except SystemExit as end:  # of argparse
        code = int(end.code or 0)
    except BaseException:
        traceback.print_exc()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)
