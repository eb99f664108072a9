"""The surface that an artist has sculpted in a Multires modifier: no property of a mesh or an object has its detail."""

from __future__ import annotations

import bpy

from .attributes import read_floats


def sculpted_surface(obj: bpy.types.Object) -> bytes:
    """The coordinates of an object's mesh with all levels of its Multires modifier; empty if it has none.

    It is computed of a copy in a scene of its own, so that nothing else is evaluated, and without shape keys, so that
    it is the same in all frames.
    """
    if not any(modifier.type == "MULTIRES" and modifier.total_levels for modifier in obj.modifiers):
        return b""
    mesh = obj.data.copy()
    copy = bpy.data.objects.new("Sculpted", mesh)
    scene = bpy.data.scenes.new("Sculpted")
    try:
        if mesh.shape_keys is not None:
            copy.shape_key_clear()
        modifier = copy.modifiers.new("Multires", "MULTIRES")  # it takes over the levels of the mesh
        modifier.levels = modifier.total_levels
        scene.collection.objects.link(copy)
        layer = scene.view_layers[0]
        layer.update()
        evaluated = copy.evaluated_get(layer.depsgraph).data
        return read_floats(evaluated.vertices, "co", 3).tobytes()
    finally:
        bpy.data.scenes.remove(scene)
        bpy.data.objects.remove(copy)
        bpy.data.meshes.remove(mesh)
