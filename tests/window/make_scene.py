"""Makes a scene to work in: `blender --background --python make_scene.py -- creature|BODIES.npz OUT.blend`.

`creature`: the extension's own walking creature, as an artist would open it. A .npz: a mesh object for each of its
pairs of arrays `vertices_0`, `faces_0`, …, all of them selected.
"""

import importlib
import sys

import bpy
import numpy as np

ADDON = "bl_ext.user_default.wks_segment"


def creature():
    """The creature in the middle of the view; its bones are hidden, as riggers do."""
    scene = bpy.context.scene
    maker = importlib.import_module(f"{ADDON}.wks_segment.blender.cli.creature")
    scene.frame_start, scene.frame_end = maker.FIRST_FRAME, maker.LAST_FRAME
    body = maker.build_creature(scene)
    body.parent.hide_set(True)
    for obj in bpy.context.view_layer.objects:
        obj.select_set(False)


def bodies(path):
    """Poses side by side, all selected."""
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


what, out = sys.argv[sys.argv.index("--") + 1 :]
for name in ("Cube", "Camera", "Light"):
    bpy.data.objects.remove(bpy.data.objects[name])
if what == "creature":
    creature()
else:
    bodies(what)
bpy.ops.wm.save_as_mainfile(filepath=out)
