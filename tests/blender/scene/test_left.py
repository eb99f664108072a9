"""Left and right of characters whose armature is turned against the mesh."""

import bpy
import numpy as np
import pytest
from boxes import CUBE, QUADS
from builders import coordinates, mesh_object

from wks_segment.blender.scene import poses as reader
from wks_segment.blender.scene.bone_sides import LEFT, RIGHT
from wks_segment.blender.scene.characters import Character

pytestmark = pytest.mark.usefixtures("scene")


def armed():
    """A body that looks along −y, with an arm on each side: its left one is at +x."""
    places = [((0, 0, 0), (1, 0.5, 2)), ((2, 0, 0.5), (2, 0.3, 0.3)), ((-2, 0, 0.5), (2, 0.3, 0.3))]
    places.append(((0, -0.6, 1.2), (0.5, 1, 0.5)))
    points = np.concatenate([CUBE / 2 * size + center for center, size in places])
    return mesh_object(points, [[8 * i + corner for corner in quad] for i in range(4) for quad in QUADS], "Body")


def turned_armature(obj, names):
    """An armature whose X is the −Y of the world, with bones of these names at +x and −x of the world."""
    data = bpy.data.armatures.new("Rig")
    armature = bpy.data.objects.new("Rig", data)
    bpy.context.scene.collection.objects.link(armature)
    bpy.context.view_layer.objects.active = armature
    bpy.ops.object.mode_set(mode="EDIT")
    for side, name in zip((1, -1), names, strict=True):
        bone = data.edit_bones.new(name)
        bone.head, bone.tail = (0, side, 0), (0, 2 * side, 0)
    bpy.ops.object.mode_set(mode="OBJECT")
    armature.rotation_euler.z = -np.pi / 2
    obj.modifiers.new("Armature", "ARMATURE").object = armature
    bpy.context.view_layer.update()
    return armature


@pytest.mark.parametrize(
    ("names", "side"), [(("arm_joint_L_1", "arm_joint_R_1"), 1), (("RightArm", "LeftArm"), -1), (("a", "b"), 1)]
)
def test_left_is_told_by_the_mesh_where_x_of_the_armature_points_to_the_front(names, side):
    obj = armed()
    turned_armature(obj, names)
    (pose,) = reader.read_objects(bpy.context, [Character((obj,))])
    np.testing.assert_allclose(pose.axes[:, 0], (0, -1, 0), atol=1e-6)
    np.testing.assert_allclose(pose.upright.vertices[:, 0], side * coordinates(obj.data)[:, 0], atol=1e-5)


@pytest.mark.parametrize("name", ["hand.L", "hand_l_01", "L-hand", "Left hand", "mixamorig:LeftHand", "leg_joint_L_1"])
def test_names_of_bones_on_the_left(name):
    assert LEFT.search(name)
    assert not RIGHT.search(name)
    other = name.replace("Left", "Right").replace("L", "R").replace("_l_", "_r_")
    assert RIGHT.search(other), other
    assert not LEFT.search(other), other


@pytest.mark.parametrize("name", ["Leg", "Head", "leftover", "Root", "spine_01", "tail"])
def test_names_of_other_bones(name):
    assert not LEFT.search(name)
    assert not RIGHT.search(name)
