"""Make a scene for a test: `blender --background --python make_scene.py -- creature|pair|BODIES.npz OUT.blend`.

`creature` is the walking creature of the demo, `pair` has a small one beside it, on the ground. A .npz file has arrays
`vertices_0`, `faces_0`, …, for each of which the scene gets a selected mesh object.
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


def pair():
    """Build two creatures, the small one named "Calf", and ground and a lamp."""
    creature()
    large = bpy.data.objects["Creature"]
    creature()
    calf = next(obj for obj in bpy.data.objects if obj.type == "MESH" and obj != large)
    calf.name = "Calf"
    calf.parent.name, calf.parent.location.x, calf.parent.scale = "Calf rig", 1.5, (0.5,) * 3
    mesh = bpy.data.meshes.new("Ground")
    mesh.from_pydata([(-4, -4, 0), (4, -4, 0), (4, 4, 0), (-4, 4, 0)], [], [(0, 1, 2, 3)])
    lamp = bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "AREA"))
    for prop in (bpy.data.objects.new("Ground", mesh), lamp):
        bpy.context.scene.collection.objects.link(prop)
    lamp.location = (0, 0, 4)


def bodies(path):
    """Add the bodies of a file side by side, all selected."""
    with np.load(path) as arrays:
        count = len(arrays.files) // 2
        for i in range(count):
            mesh = bpy.data.meshes.new(f"Pose {i + 1}")
            mesh.from_pydata(arrays[f"vertices_{i}"].tolist(), [], arrays[f"faces_{i}"].tolist())
            obj = bpy.data.objects.new(mesh.name, mesh)
            obj.location.x = 3 * i
            bpy.context.scene.collection.objects.link(obj)
            obj.select_set(True)
            bpy.context.view_layer.objects.active = obj
    if count > 1:
        bpy.context.scene.wks_segment.source = "OBJECTS"


content, out = sys.argv[sys.argv.index("--") + 1 :]
for name in ("Cube", "Camera", "Light"):
    bpy.data.objects.remove(bpy.data.objects[name])
if content in ("creature", "pair"):
    globals()[content]()
else:
    bodies(content)
bpy.ops.wm.save_as_mainfile(filepath=out)
