"""Learn a character's parts from frames of its animation, in plain Python.

    blender --background --python-exit-code 1 --python examples/segment_frames.py -- walk.glb labeled.blend

Writes out the main steps of the operators, so that you can change each: other poses, another model, another use of the
labels. Needs the installed extension, or `pip install -e .` in a Python with the bpy module.
The largest mesh of the file is used.
"""

import importlib
import sys
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

FRAMES = (1, 8, 15, 22, 29)
SEGMENTS = 6


def import_from_package(name: str) -> Any:
    """Import a module of the package, from the installed extension or from the Python environment."""
    for package in sys.modules:
        if package.startswith("bl_ext.") and package.endswith(".wks_segment.wks_segment"):
            return importlib.import_module(f"{package}.{name}")
    return importlib.import_module(f"wks_segment.{name}")


def triangles_of(obj: bpy.types.Object) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    """Vertices, triangles and the polygon of each triangle of an object with its modifiers in the current frame."""
    evaluated = obj.evaluated_get(bpy.context.evaluated_depsgraph_get())
    mesh = evaluated.to_mesh()
    mesh.calc_loop_triangles()
    vertices = np.array([vertex.co for vertex in mesh.vertices])
    triangles = np.array([triangle.vertices for triangle in mesh.loop_triangles])
    polygons = np.array([triangle.polygon_index for triangle in mesh.loop_triangles])
    evaluated.to_mesh_clear()
    return vertices, triangles, polygons


def main(source: str, target: str) -> None:
    """Learn segments from the animation in a file, label its largest mesh and save the scene."""
    core, outputs = import_from_package("core"), import_from_package("blender.outputs.labels")
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.ops.import_scene.gltf(filepath=source)
    obj = max((o for o in bpy.data.objects if o.type == "MESH"), key=lambda o: len(o.data.vertices))

    poses, polygons = [], []
    for frame in FRAMES:
        bpy.context.scene.frame_set(frame)
        vertices, triangles, polygon_of = triangles_of(obj)
        poses.append(core.TriangleMesh(vertices, triangles))
        polygons.append(polygon_of)

    model = core.PoseSegmentation(n_segments=SEGMENTS)
    described = model.describe_all(poses)  # computes eigenpairs and signatures, which takes most of the time
    model.fit(described)
    labels = model.segment_polygons(described, polygons)

    outputs.write_labels(obj.data, labels)  # attributes and colors
    model.save(f"{target}.model.json")
    bpy.ops.wm.save_as_mainfile(filepath=target)
    for k in range(SEGMENTS):
        print(f"segment {k}: {np.mean(labels == k):.0%} of the faces")


if __name__ == "__main__":
    main(*sys.argv[sys.argv.index("--") + 1 :])
