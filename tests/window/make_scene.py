"""Make a scene for a test: `blender --background --python make_scene.py -- creature|BODIES.npz OUT.blend`.

`creature` is the walking creature of the demo. A .npz file has arrays `vertices_0`, `faces_0`, …, for each of which the
scene gets a selected mesh object.
"""

import importlib
import sys

import bpy
import numpy as np

ADDON = "bl_ext.user_default.wks_segment"


def creature():
    """Build the creature, with its armature hidden."""
    scene = bpy.context.scene
    builder = importlib.import_module(f"{ADDON}.wks_segment.blender.cli.creature")
    scene.frame_start, scene.frame_end = builder.FIRST_FRAME, builder.LAST_FRAME
    body = builder.build_creature(scene)
    body.parent.hide_set(True)
    for obj in bpy.context.view_layer.objects:
        obj.select_set(False)


def bodies(path):
    """Add the bodies of a file side by side, all selected."""
    with np.load(path) as arrays:
        for i in range(len(arrays.files) // 2):
            mesh = bpy.data.meshes.new(f"Pose {i + 1}")
            mesh.from_pydata(arrays[f"vertices_{i}"].tolist(), [], arrays[f"faces_{i}"].tolist())
            obj = bpy.data.objects.new(mesh.name, mesh)
            obj.location.x = 3 * i
            bpy.context.scene.collection.objects.link(obj)
            obj.select_set(True)
            bpy.context.view_layer.objects.active = obj
    bpy.context.scene.wks_segment.source = "OBJECTS"


content, out = sys.argv[sys.argv.index("--") + 1 :]
for name in ("Cube", "Camera", "Light"):
    bpy.data.objects.remove(bpy.data.objects[name])
if content == "creature":
    creature()
else:
    bodies(content)
bpy.ops.wm.save_as_mainfile(filepath=out)
