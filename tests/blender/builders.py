"""Builders of small characters, and helpers that read meshes, scenes and commands."""

import json
from functools import cache

import bpy
import numpy as np
import pytest

import bmesh  # isort: skip  # part of Blender, which must be loaded first

from wks_segment.blender.outputs.ledger import LEDGER
from wks_segment.blender.outputs.part_attributes import has_labels

LIMBS = np.array([[1.0, 0.0, 0.2], [-0.5, 0.8, 0.1], [-0.4, -0.7, -0.5]])
"""Directions of the three limbs of the test character."""
LENGTHS = np.array([2.2, 1.5, 1.0])
"""How far each limb sticks out of the unit sphere."""
UPPER = 1.3
"""Where the longest limb bends, along x."""


@cache
def _sphere(subdivisions):
    sphere = bmesh.new()
    bmesh.ops.create_icosphere(sphere, subdivisions=subdivisions, radius=1.0)
    points = np.array([vertex.co for vertex in sphere.verts])
    faces = np.array([[vertex.index for vertex in face.verts] for face in sphere.faces])
    sphere.free()
    return points, faces


def limbed_surface(bend=0.0, subdivisions=4):
    """Points and triangles of a ball with three limbs, the longest of which is bent upwards."""
    points, faces = _sphere(subdivisions)
    toward = np.arccos(np.clip(points @ (LIMBS / np.linalg.norm(LIMBS, axis=1)[:, None]).T, -1, 1))
    points = points * (1 + np.exp(-((toward / 0.45) ** 2)) @ LENGTHS)[:, None]
    return bent(points, bend), faces


def bent(points, bend):
    """The points with the end of the longest limb turned about the y axis, by an angle."""
    beyond = np.clip(points[:, 0] - UPPER, 0, None)
    result = points.copy()
    result[:, 0] += beyond * (np.cos(bend) - 1)
    result[:, 2] += beyond * np.sin(bend)
    return result


def mesh_object(points, faces, name="Object"):
    """An object of the current scene with these vertices and faces."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(np.asarray(points).tolist(), [], [list(map(int, face)) for face in faces])
    obj = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(obj)
    bpy.context.view_layer.update()
    return obj


def limbed(name="Limbed", bend=0.0, subdivisions=4):
    """A ball with three limbs, in one pose."""
    return mesh_object(*limbed_surface(bend, subdivisions), name)


def limbed_poses(*bends, subdivisions=4):
    """A ball with three limbs, one object for each pose."""
    return [limbed(f"Pose {i}", bend, subdivisions) for i, bend in enumerate(bends)]


def limbed_keys(*bends, name="Keyed"):
    """A ball with three limbs, with a shape key for each pose after the basis."""
    obj = limbed(name)
    basis = coordinates(obj.data)
    obj.shape_key_add(name="Basis")
    for bend in bends:
        obj.shape_key_add(name=f"Bend {bend}").data.foreach_set("co", bent(basis, bend).ravel())
    return obj


def rig(objects, name="Rig", bends=((1, 0.0), (11, 0.9), (21, -0.5))):
    """An armature that bends the longest limb of objects, keyed at frames with angles."""
    data = bpy.data.armatures.new(name)
    armature = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(armature)
    bpy.context.view_layer.objects.active = armature
    bpy.ops.object.mode_set(mode="EDIT")
    root = data.edit_bones.new("root")
    root.head, root.tail = (0, 0, 0), (UPPER, 0, 0)
    limb = data.edit_bones.new("limb")
    limb.head, limb.tail, limb.parent = (UPPER, 0, 0), (UPPER + 2, 0, 0), root
    bpy.ops.object.mode_set(mode="OBJECT")
    bone = armature.pose.bones["limb"]
    bone.rotation_mode = "XYZ"
    for frame, bend in bends:
        bone.rotation_euler = (bend, 0, 0)
        bone.keyframe_insert("rotation_euler", frame=frame)
    for obj in objects:
        weight = np.clip(3 * (coordinates(obj.data)[:, 0] - UPPER) + 0.5, 0, 1)
        groups = {bone_name: obj.vertex_groups.new(name=bone_name) for bone_name in ("root", "limb")}
        for i, share in enumerate(weight.tolist()):
            groups["limb"].add([i], share, "REPLACE")
            groups["root"].add([i], 1 - share, "REPLACE")
        obj.parent = armature
        obj.modifiers.new("Armature", "ARMATURE").object = armature
    bpy.context.scene.frame_set(bends[0][0])
    return armature


def limbed_rigged(name="Walker", **options):
    """A ball with three limbs whose longest one an armature bends, over frames 1 to 21."""
    obj = limbed(name)
    rig([obj], **options)
    return obj


def select(*objects):
    """Select objects and nothing else; the first is active."""
    bpy.context.view_layer.update()
    for obj in bpy.context.view_layer.objects:
        obj.select_set(obj in objects)
    bpy.context.view_layer.objects.active = objects[0] if objects else None


def choose(obj, chosen):
    """Select faces in Edit Mode."""
    if bpy.context.mode == "OBJECT":
        bpy.ops.object.mode_set(mode="EDIT")
    bpy.context.scene.tool_settings.mesh_select_mode = (False, False, True)
    faces = bmesh.from_edit_mesh(obj.data)
    for face in faces.faces:
        face.select_set(bool(chosen[face.index]))
    faces.select_flush_mode()
    bmesh.update_edit_mesh(obj.data)


def chosen_in_edit_mode(obj):
    """Whether each face and each vertex is selected."""
    found = bmesh.from_edit_mesh(obj.data)
    return np.array([face.select for face in found.faces]), np.array([vertex.select for vertex in found.verts])


def add_face(mesh):
    """Add a loose triangle in Edit Mode."""
    found = bmesh.from_edit_mesh(mesh)
    found.faces.new([found.verts.new(place) for place in ((9, 0, 0), (9, 1, 0), (9, 0, 1))])
    bmesh.update_edit_mesh(mesh)


def coordinates(mesh):
    """(n, 3) array of a mesh's own coordinates."""
    points = np.empty((len(mesh.vertices), 3), dtype=np.float32)
    mesh.vertices.foreach_get("co", points.ravel())
    return points.astype(np.float64)


def numbers(mesh, name, prop="value", width=1):
    """The values of an attribute, as an array."""
    data = mesh.attributes[name].data
    values = np.empty(len(data) * width, dtype=np.float64)
    data.foreach_get(prop, values)
    return values if width == 1 else values.reshape(-1, width)


def labels_of(obj):
    """(p,) parts that were written to an object's faces."""
    return numbers(obj.data, "wks_segment").astype(int)


PROPERTIES = {
    "INT16_2D": ("value", 2),
    "FLOAT_VECTOR": ("vector", 3), "FLOAT2": ("vector", 2), "BYTE_COLOR": ("color", 4), "FLOAT_COLOR": ("color", 4),
}  # fmt: skip


READABLE = {".sculpt_face_set", ".uv_seam", ".hide_poly"}


def snapshot(mesh):
    """Everything of a mesh that an artist could miss, in a form that can be compared."""
    attributes = {}
    for attribute in mesh.attributes:
        values = b""
        # Of its own ones Blender 5.0 gives some a wrong type.
        if not attribute.name.startswith(".") or attribute.name in READABLE:
            prop, width = PROPERTIES.get(attribute.data_type, ("value", 1))
            values = numbers(mesh, attribute.name, prop, width).tobytes()  # in which NaN equals NaN
        attributes[attribute.name] = (attribute.domain, attribute.data_type, values)
    corners = np.empty(len(mesh.loops), dtype=np.int32)
    mesh.loops.foreach_get("vertex_index", corners)
    material_index = np.empty(len(mesh.polygons), dtype=np.int32)
    mesh.polygons.foreach_get("material_index", material_index)
    active = mesh.attributes.active
    return {
        "attributes": attributes,
        "active attribute": active.name if active else None,
        "active color": mesh.attributes.active_color_name,
        "default color": mesh.attributes.default_color_name,
        "render color": mesh.color_attributes.render_color_index,
        "active uv": mesh.uv_layers.active_index,
        "render uv": [layer.active_render for layer in mesh.uv_layers],
        "selection": [select_flags(of).tobytes() for of in (mesh.vertices, mesh.edges, mesh.polygons)],
        "slots": [material.name if material else None for material in mesh.materials],
        "material index": material_index.tolist(),
        "properties": {key: getattr(value, "to_dict", lambda value=value: value)() for key, value in mesh.items()},
        "corners": corners.tolist(),
        "size": (len(mesh.vertices), len(mesh.edges), len(mesh.polygons)),
    }


def select_flags(collection):
    """Which elements are selected and which are hidden."""
    flags = np.empty((2, len(collection)), dtype=bool)
    collection.foreach_get("select", flags[0])
    collection.foreach_get("hide", flags[1])
    return flags


def groups_snapshot(obj):
    """Vertex groups of an object, and which vertex is in which."""
    groups = [(group.name, group.lock_weight) for group in obj.vertex_groups]
    members = [(g.group, g.weight) for vertex in obj.data.vertices for g in vertex.groups]
    return groups, obj.vertex_groups.active_index, hash(tuple(members))


def object_snapshot(obj):
    """Everything of an object that an artist could miss."""
    mesh = obj.type == "MESH"
    return {
        "selected": obj.select_get(),
        "hidden": (obj.hide_get(), obj.hide_viewport, obj.hide_render),
        "data": obj.data.name if obj.data else None,
        "parent": (obj.parent and obj.parent.name, obj.parent_type, obj.parent_bone),
        "place": [tuple(row) for m in (obj.matrix_world, obj.matrix_parent_inverse) for row in m],
        "collections": sorted(collection.name for collection in obj.users_collection),
        "modifiers": [(modifier.name, modifier.type) for modifier in obj.modifiers],
        "slots": [(slot.link, slot.material and slot.material.name) for slot in obj.material_slots],
        "keys": (obj.active_shape_key_index, obj.show_only_shape_key),
        "groups": groups_snapshot(obj) if mesh else None,
        "properties": sorted(obj.keys()),
        "pose": pose_snapshot(obj) if obj.type == "ARMATURE" else None,
    }


def pose_snapshot(armature):
    """Pose of an armature, and what moves it."""
    data = armature.animation_data
    moved_by = data and (data.action and data.action.name, getattr(data, "action_slot", None), data.use_nla)
    bones = {
        bone.name: (
            bone.rotation_mode, *bone.location, *bone.rotation_quaternion, *bone.rotation_euler, *bone.scale,
            *bone.rotation_axis_angle,
        )
        for bone in armature.pose.bones
    }  # fmt: skip
    return {"moved by": str(moved_by), "bones": bones, "position": armature.data.pose_position}


def image_snapshot(image):
    """Pixels of an image, and how their numbers are interpreted."""
    values = np.empty(image.channels * image.size[0] * image.size[1], dtype=np.float32)
    image.pixels.foreach_get(values)
    return (tuple(image.size), image.colorspace_settings.name, values.tobytes())


def scene_snapshot():
    """All meshes, materials, images and objects of the file, and what the scene shows."""
    context, tools = bpy.context, bpy.context.scene.tool_settings
    return {
        "meshes": {mesh.name: snapshot(mesh) for mesh in bpy.data.meshes},
        "objects": {obj.name: object_snapshot(obj) for obj in bpy.data.objects},
        "images": {image.name: image_snapshot(image) for image in bpy.data.images if image.type != "RENDER_RESULT"},
        "engine": context.scene.render.engine,
        "tools": (tools.use_uv_select_sync, tuple(tools.mesh_select_mode)),
        "materials": sorted(material.name for material in bpy.data.materials),
        "scenes": [scene.name for scene in bpy.data.scenes],
        "active": context.view_layer.objects.active and context.view_layer.objects.active.name,
        "frame": (context.scene.frame_current, context.scene.frame_subframe),
        "model": (context.scene.wks_segment.model, context.scene.wks_segment.model_summary),
        "notes": {row.name: notes for row in context.scene.wks_segment.label_sets if (notes := said(row))},
        "segments": listed(context.scene.wks_segment),
    }


def said(row):
    """What a user said about the parts of a label set."""
    return {name: value for name, value in json.loads(row.notes).items() if name != "palette"}


def listed(settings):
    """The list of segments as the panel shows it."""
    return [(item.number, item.name, round(item.share, 3), item.hidden) for item in settings.segments]


def changes(before, after, path=""):
    """Where two snapshots differ, as paths."""
    if isinstance(before, dict) and isinstance(after, dict):
        keys = sorted(before.keys() | after.keys())
        return [change for key in keys for change in changes(before.get(key), after.get(key), f"{path}/{key}")]
    return [] if before == after else [path]


class Outcome:
    """How a command ended: its exit code and what it printed."""

    def __init__(self, code, out, err):
        self.code, self.out, self.err = code, out, err

    @property
    def result(self):
        """The JSON object that it printed, if it printed that and nothing else."""
        assert self.out.count("\n") == 1, f"not one line on standard output:\n{self.out}"
        return json.loads(self.out)

    def __repr__(self):
        return f"exit code {self.code}\nstandard output:\n{self.out}\nstandard error:\n{self.err}"


def read_labels(mesh):
    """(p,) parts that were written to the polygons of a mesh, found by its ledger; None if there are none."""
    name = mesh[LEDGER].get("faces", "") if has_labels(mesh) else ""
    if name not in mesh.attributes:
        return None
    labels = np.empty(len(mesh.polygons), dtype=np.int32)
    mesh.attributes[name].data.foreach_get("value", labels)
    return labels


def error_of(operator, **options):
    """What an operator reports as an error; empty if it worked."""
    try:
        operator(**options)
    except RuntimeError as error:
        return str(error)
    return ""


def refuses(operator, match, **options):
    """Assert that an operator refuses with this message, and that nothing in the file has changed."""
    before = scene_snapshot()
    with pytest.raises(RuntimeError, match=match):
        operator(**options)
    assert not changes(before, scene_snapshot())
