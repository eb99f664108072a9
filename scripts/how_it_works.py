"""Make the six pictures of docs/how_it_works.md, from the mesh to its parts: `python -m scripts.how_it_works`.

Each shows the creature of the demo in two poses. Needs bpy and Pillow (`make` installs both in .venv).
"""

from __future__ import annotations

import bpy
import numpy as np
from mathutils import Vector

import wks_segment.blender
from scripts._pictures import FOLDER, Body, axes_of_view, rendered, run
from wks_segment.blender.cli.demo_scene import creature_in
from wks_segment.blender.parts.part_style import Style
from wks_segment.blender.scene.poses import Pose, read_pose
from wks_segment.core import PoseSegmentation, eigenpairs
from wks_segment.core.mesh.triangle_mesh import FloatArray

SIZE = (720, 320)
"""Width and height of a picture, in pixels."""
LEARNED, SHOWN = (1, 10, 20, 32, 44), (1, 20)
"""Frames of the creature to learn from, and those in the pictures."""
DEEP, HIGH = 3, 40
"""The vibrations that are shown: a slow one of the whole body, and a fast one."""
ENERGY = 45
"""The energy of the signature that is shown: one at which feet, head and tail differ clearly."""
SEGMENT = 1
"""The segment whose probability is shown."""
N_COLORS = 128
VIEW_DIRECTION = Vector((-0.85, -1.0, 0.45))
DIVERGING = np.array([[0.13, 0.35, 0.75], [0.93, 0.93, 0.93], [0.80, 0.18, 0.15]])
SEQUENTIAL = np.array([[0.15, 0.16, 0.40], [0.13, 0.55, 0.55], [0.55, 0.80, 0.30], [0.99, 0.91, 0.20]])
"""sRGB of low to high values, with and without a sign."""


def main() -> None:
    """Make the pictures."""
    wks_segment.blender.register()
    character = creature_in(bpy.context.scene)
    poses = {}
    for frame in LEARNED:
        bpy.context.scene.frame_set(frame)
        poses[frame] = read_pose(bpy.context, character, f"frame {frame}")
    shown = [poses[frame] for frame in SHOWN]
    meshes = [pose.mesh for pose in shown]
    model = PoseSegmentation().fit([pose.mesh for pose in poses.values()])
    functions = [eigenpairs(mesh, HIGH + 5)[1] for mesh in meshes]
    described = model.describe_all(meshes)
    draw("how_1_mesh", shown, [np.full((mesh.n_vertices, 3), 0.65) for mesh in meshes])
    for name, number in (("how_2_slow_vibration", DEEP), ("how_3_fast_vibration", HIGH)):
        values = [each[:, number] for each in functions]
        draw(name, shown, [shades(DIVERGING, each, -2.2, 2.2) for each in values])
    values = [each.signature[each.surface.vertex_of, ENERGY] for each in described]
    low, high = np.quantile(np.concatenate(values), [0.02, 0.98])
    draw("how_4_signature", shown, [shades(SEQUENTIAL, each, low, high) for each in values])
    draw(
        "how_5_probability", shown, [shades(SEQUENTIAL, model.predict_soft(mesh)[:, SEGMENT], 0, 1) for mesh in meshes]
    )
    faces = [Style().colors_of(model.segment_faces(mesh)) for mesh in meshes]
    draw("how_6_parts", shown, faces)


def shades(scale: FloatArray, values: FloatArray, low: float, high: float) -> FloatArray:
    """(n, 3) color of each value on a scale."""
    place = np.clip((values - low) / (high - low), 0, 1)
    return np.stack([np.interp(place, np.linspace(0, 1, len(scale)), channel) for channel in scale.T], axis=1)


def draw(name: str, poses: list[Pose], colors: list[FloatArray]) -> None:
    """Render poses side by side, in (n, 3) colors of their vertices or (m, 3) of their faces, to a file of the docs."""
    axes = axes_of_view(VIEW_DIRECTION)
    placed = [pose.mesh.vertices @ axes.T for pose in poses]
    size = 1.1 * max(np.ptp(points[:, 0]) for points in placed)
    bodies: list[Body] = []
    for i, (pose, points, color) in enumerate(zip(poses, placed, colors, strict=True)):
        middle = (points.min(axis=0) + points.max(axis=0)) / 2
        bodies.append(((points - middle) / size + [i - 0.5, 0, 0], pose.mesh.faces, color))
    picture = rendered(bodies, 2.0, SIZE, smooth=True)
    picture.quantize(N_COLORS).save(FOLDER / f"{name}.png", optimize=True)
    print(FOLDER / f"{name}.png", flush=True)


if __name__ == "__main__":
    run(main)
