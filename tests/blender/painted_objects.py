"""Objects that an artist has worked on, labels by height, and what an operator and undo change."""

import bpy
import numpy as np
from builders import (
    changes,
    scene_snapshot,
)

FACE_SETS = ".sculpt_face_set"


def stripes(mesh, count=4):
    """Labels by height."""
    height = np.array([polygon.center.z for polygon in mesh.polygons])
    return np.digitize(height, np.linspace(height.min(), height.max(), count + 1)[1:-1])


def seams_of(mesh):
    return np.array([edge.use_seam for edge in mesh.edges])


def painted(obj):
    """An object with materials, seams, face sets, a UV map, vertex groups and a selection of an artist."""
    mesh = obj.data
    for name in ("Skin", "Cloth"):
        mesh.materials.append(bpy.data.materials.new(name))
    mesh.polygons.foreach_set("material_index", np.arange(len(mesh.polygons), dtype=np.int32) % 2)
    mesh.edges.foreach_set("use_seam", np.arange(len(mesh.edges)) % 7 == 0)
    mesh.attributes.new(FACE_SETS, "INT", "FACE").data.foreach_set("value", 1 + np.arange(len(mesh.polygons)) // 100)
    uvs = np.linspace(0, 1, 2 * len(mesh.loops), dtype=np.float32)
    mesh.uv_layers.new(name="First").data.foreach_set("uv", uvs)
    mesh.uv_layers.new(name="Second").data.foreach_set("uv", uvs[::-1].copy())
    mesh.uv_layers.active = mesh.uv_layers["Second"]
    obj.vertex_groups.new(name="Mine").add([1, 2, 3], 0.5, "REPLACE")
    mesh.polygons.foreach_set("select", np.arange(len(mesh.polygons)) % 3 == 0)
    mesh.update()
    return obj


def undone(operator, **options):
    """What changes by an operator, and what is changed still when it is undone."""
    before = scene_snapshot()
    bpy.ops.ed.undo_push(message="before")
    assert operator(**options) == {"FINISHED"}
    after = scene_snapshot()
    bpy.ops.ed.undo_push(message="after")
    assert bpy.ops.ed.undo() == {"FINISHED"}
    return changes(before, after), changes(before, scene_snapshot())
