"""A four-legged creature that walks: a character for the demo and the tests."""

from math import pi, radians, sin
from typing import NamedTuple

import bpy
from mathutils import Vector

FIRST_FRAME = 1
LAST_FRAME = 48


class Joint(NamedTuple):
    """A joint of the skeleton, at the end of the bone of the same name, which starts at the joint `parent`.

    In meters; the creature faces −Y and stands on Z = 0. A name that ends in ``.L`` stands for a pair: the joint and
    its mirror image ``.R`` at −X.
    """

    name: str
    parent: str
    position: tuple[float, float, float]
    radius: float


# Positions and radii are those of the control cage; the subdivided surface lies slightly inside.
JOINTS = (
    Joint("pelvis", "", (0.0, 0.56, 0.84), 0.21),
    Joint("loin", "pelvis", (0.0, 0.24, 0.85), 0.26),
    Joint("waist", "loin", (0.0, 0.07, 0.86), 0.28),
    Joint("ribs", "waist", (0.0, -0.10, 0.86), 0.27),
    Joint("chest", "ribs", (0.0, -0.42, 0.86), 0.23),
    Joint("withers", "chest", (0.0, -0.62, 1.06), 0.19),
    Joint("neck", "withers", (0.0, -0.69, 1.2), 0.15),
    Joint("nape", "neck", (0.0, -0.74, 1.34), 0.18),
    Joint("skull", "nape", (0.0, -0.84, 1.52), 0.24),
    Joint("brow", "skull", (0.0, -1.03, 1.53), 0.28),
    Joint("snout", "brow", (0.0, -1.26, 1.43), 0.16),
    Joint("nose", "snout", (0.0, -1.40, 1.41), 0.13),
    Joint("ear.L", "skull", (0.22, -0.80, 1.78), 0.085),
    Joint("ear_mid.L", "ear.L", (0.27, -0.76, 1.89), 0.11),
    Joint("ear_tip.L", "ear_mid.L", (0.36, -0.70, 2.06), 0.03),
    Joint("shoulder.L", "chest", (0.22, -0.44, 0.54), 0.125),
    Joint("elbow.L", "shoulder.L", (0.23, -0.41, 0.37), 0.105),
    Joint("wrist.L", "elbow.L", (0.23, -0.42, 0.18), 0.09),
    Joint("ball.L", "wrist.L", (0.23, -0.50, 0.085), 0.085),
    Joint("paw.L", "ball.L", (0.23, -0.60, 0.085), 0.1),
    Joint("hip.L", "pelvis", (0.22, 0.58, 0.54), 0.125),
    Joint("knee.L", "hip.L", (0.23, 0.55, 0.37), 0.115),
    Joint("ankle.L", "knee.L", (0.23, 0.58, 0.18), 0.09),
    Joint("heel.L", "ankle.L", (0.23, 0.50, 0.085), 0.085),
    Joint("foot.L", "heel.L", (0.23, 0.40, 0.085), 0.1),
    Joint("tail_1", "pelvis", (0.0, 0.82, 0.88), 0.14),
    Joint("tail_2", "tail_1", (0.0, 1.04, 0.86), 0.12),
    Joint("tail_3", "tail_2", (0.0, 1.24, 0.84), 0.105),
    Joint("tail_4", "tail_3", (0.0, 1.44, 0.84), 0.09),
    Joint("tail_5", "tail_4", (0.0, 1.64, 0.88), 0.075),
    Joint("tail_6", "tail_5", (0.0, 1.82, 0.96), 0.06),
    Joint("tail_7", "tail_6", (0.0, 1.98, 1.06), 0.045),
)
# Start of the bone of the first joint: in the belly, so that the whole body sways about its middle.
ROOT_HEAD = (0.0, 0.06, 0.80)
RING_SPACING = 0.06
# Distance of a limb's last ring beyond its joint, and radius of that ring, in radii of the joint: a round end.
TIP_REACH = 0.5
TIP_RADIUS = 0.65
SUBDIVISIONS = 2


class Swing(NamedTuple):
    """A bone's rotation about one of its axes: ``mean + amplitude · sin(2π · cycles · t + phase)``, degrees.

    Axis 0 is pitch, 1 twist, 2 yaw; t runs from 0 to 1 over the action.
    """

    bone: str
    axis: int
    mean: float
    amplitude: float
    cycles: int
    phase: float


STRIDES = 2
LEG_SWINGS = (
    Swing("elbow", 0, 0.0, 32.0, STRIDES, 0.0),
    Swing("wrist", 0, -18.0, 22.0, STRIDES, 80.0),
    Swing("ball", 0, 5.0, 15.0, STRIDES, -40.0),
    Swing("knee", 0, 0.0, 32.0, STRIDES, 180.0),
    Swing("ankle", 0, -6.0, 20.0, STRIDES, 250.0),
    Swing("heel", 0, 0.0, 14.0, STRIDES, 140.0),
)
SWINGS = (
    # The right legs follow half a stride after the left ones.
    *(swing._replace(bone=f"{swing.bone}.L") for swing in LEG_SWINGS),
    *(swing._replace(bone=f"{swing.bone}.R", phase=swing.phase + 180.0) for swing in LEG_SWINGS),
    Swing("pelvis", 0, 0.0, 2.0, 2 * STRIDES, 0.0),
    Swing("pelvis", 1, 0.0, 4.0, STRIDES, 0.0),
    Swing("waist", 2, 0.0, 8.0, STRIDES, 60.0),
    Swing("ribs", 2, 0.0, 8.0, STRIDES, 60.0),
    Swing("chest", 0, 0.0, 3.0, 1, 0.0),
    Swing("neck", 0, 0.0, 14.0, 1, 0.0),
    Swing("neck", 2, 0.0, 10.0, 1, 90.0),
    Swing("nape", 0, 0.0, 14.0, 1, 0.0),
    Swing("nape", 2, 0.0, 14.0, 1, 90.0),
    Swing("skull", 0, 0.0, 14.0, 1, -30.0),
    Swing("skull", 1, 0.0, 8.0, 1, 0.0),
    Swing("skull", 2, 0.0, 14.0, 1, 90.0),
    Swing("ear_tip.L", 0, 0.0, 14.0, STRIDES, 0.0),
    Swing("ear_tip.R", 0, 0.0, 14.0, STRIDES, 60.0),
    *(Swing(f"tail_{i}", 0, -8.0, 12.0, 1, -30.0 * i) for i in range(1, 8)),
    *(Swing(f"tail_{i}", 2, 0.0, 14.0, STRIDES, -40.0 * i) for i in range(1, 8)),
)
KEY_STEP = 3
# Axis of pitch of all bones: a rotation about it lifts a bone that points forwards, and swings a leg forwards.
HINGE = Vector((-1.0, 0.0, 0.0))


class Ring(NamedTuple):
    """A ring of the control cage: center and radius in meters, weights of its bones, index of the previous ring."""

    center: Vector
    radius: float
    weights: dict[str, float]
    previous: int


def build_creature(scene: bpy.types.Scene) -> bpy.types.Object:
    """Build an animated creature in a scene; return its mesh object.

    The mesh is one closed surface of 6632 quads, 0.8 m wide, 3.5 m long and 2.1 m high. Its parent is an
    armature whose action loops from ``FIRST_FRAME`` to ``LAST_FRAME``. The scene's frame range, selection and
    active object stay as they are.
    """
    joints = _both_sides()
    body = _build_body(scene, joints)
    armature = _build_armature(scene, joints)
    _animate(armature)
    body.parent = armature
    body.modifiers.new("Armature", "ARMATURE").object = armature
    # Keys alone do not move the pose: it would stay at the last key until the frame changes.
    armature.update_tag(refresh={"TIME"})
    scene.view_layers[0].update()
    return body


def _both_sides() -> list[Joint]:
    """``JOINTS`` followed by the right partner of each left joint; parents come before children."""
    right = []
    for name, parent, (x, y, z), radius in JOINTS:
        if name.endswith(".L"):
            right.append(Joint(name.replace(".L", ".R"), parent.replace(".L", ".R"), (-x, y, z), radius))
    return [*JOINTS, *right]


def _rings(joints: list[Joint]) -> list[Ring]:
    """Rings of the control cage along all bones that end in `joints`, those of the root first."""
    named = {joint.name: joint for joint in joints}
    children = {joint.name: [other.name for other in joints if other.parent == joint.name] for joint in joints}
    rings: list[Ring] = []
    last: dict[str, int] = {"": -1}
    for joint in joints:
        name, radius = joint.name, joint.radius
        parent = named.get(joint.parent, joint)
        start, end = Vector(parent.position), Vector(joint.position)
        # At a branch, the skin modifier builds a hull around the nearest rings, which must be well apart.
        at_branch = len(children[parent.name]) > 1 or len(children[name]) > 1
        steps = 1 if at_branch else round((end - start).length / RING_SPACING)
        previous = last[joint.parent]
        for t in ((step + 1) / steps for step in range(steps)):
            # Equal weights of both bones at a hinge, one bone alone at its middle: a smooth bend, and no limb moves
            # another one. At a branch, the trunk stays stiff.
            weights = {name: 1.0}
            neighbors = [parent.name] if t < 0.5 else children[name]
            if len(neighbors) == 1:
                weights = {name: 1.0 - abs(t - 0.5), neighbors[0]: abs(t - 0.5)}
            rings.append(Ring(start.lerp(end, t), (1 - t) * parent.radius + t * radius, weights, previous))
            previous = len(rings) - 1
        if not children[name]:
            tip = end + (end - start).normalized() * (TIP_REACH * radius)
            rings.append(Ring(tip, TIP_RADIUS * radius, {name: 1.0}, previous))
        last[name] = previous
    return rings


def _build_body(scene: bpy.types.Scene, joints: list[Joint]) -> bpy.types.Object:
    """Add an object whose mesh surrounds the bones of `joints`, with a vertex group of weights for each bone."""
    rings = _rings(joints)
    edges = [(ring.previous, i) for i, ring in enumerate(rings) if ring.previous >= 0]
    sketch = bpy.data.meshes.new("Creature sketch")
    sketch.from_pydata([ring.center for ring in rings], edges, [])
    body = bpy.data.objects.new("Creature", sketch)
    scene.collection.objects.link(body)
    groups = {joint.name: body.vertex_groups.new(name=joint.name) for joint in joints}
    body.modifiers.new("Skin", "SKIN").use_smooth_shade = True
    body.modifiers.new("Subdivision", "SUBSURF").levels = SUBDIVISIONS
    for i, ring in enumerate(rings):
        point = sketch.skin_vertices[0].data[i]
        point.radius = (ring.radius, ring.radius)
        point.use_root = ring.previous < 0
        # Otherwise Blender adds rings next to a branch, which intersect each other.
        point.use_loose = True
        # Both modifiers pass on vertex groups, so that the surface gets the weights of the rings.
        for bone, weight in ring.weights.items():
            groups[bone].add([i], weight, "REPLACE")

    view_layer = scene.view_layers[0]
    view_layer.update()
    depsgraph = view_layer.depsgraph
    body.data = bpy.data.meshes.new_from_object(
        body.evaluated_get(depsgraph), preserve_all_data_layers=True, depsgraph=depsgraph
    )
    body.data.name = "Creature"
    body.modifiers.clear()
    bpy.data.meshes.remove(sketch)
    return body


def _build_armature(scene: bpy.types.Scene, joints: list[Joint]) -> bpy.types.Object:
    """Add an armature with one bone for each of `joints`, all with the same axis of pitch."""
    armature = bpy.data.objects.new("Creature rig", bpy.data.armatures.new("Creature rig"))
    scene.collection.objects.link(armature)
    heads = {joint.name: joint.position for joint in joints}
    view_layer = scene.view_layers[0]
    # Bones can be added only in edit mode, which uses the active object of the view layer.
    active = view_layer.objects.active
    view_layer.objects.active = armature
    with bpy.context.temp_override(scene=scene, view_layer=view_layer, active_object=armature):
        bpy.ops.object.mode_set(mode="EDIT")
        for joint in joints:
            bone = armature.data.edit_bones.new(joint.name)
            bone.head = heads.get(joint.parent, ROOT_HEAD)
            bone.tail = joint.position
            bone.parent = armature.data.edit_bones.get(joint.parent)
            bone.align_roll(HINGE.cross(bone.vector))
        bpy.ops.object.mode_set(mode="OBJECT")
    view_layer.objects.active = active
    return armature


def _animate(armature: bpy.types.Object) -> None:
    """Add keyframes for ``SWINGS``; the last one lies one frame after ``LAST_FRAME`` and equals the first."""
    length = LAST_FRAME + 1 - FIRST_FRAME
    for bone_name in dict.fromkeys(swing.bone for swing in SWINGS):
        bone = armature.pose.bones[bone_name]
        bone.rotation_mode = "XYZ"
        for step in range(0, length + 1, KEY_STEP):
            angles = [0.0, 0.0, 0.0]
            for swing in SWINGS:
                if swing.bone == bone_name:
                    turn = 2.0 * pi * swing.cycles * step / length + radians(swing.phase)
                    angles[swing.axis] += radians(swing.mean + swing.amplitude * sin(turn))
            bone.rotation_euler = angles
            bone.keyframe_insert("rotation_euler", frame=FIRST_FRAME + step)
    armature.animation_data.action.name = "Creature walk"
