"""Plain names of the bones of common rigs, and their sides."""

import pytest

from wks_segment.rigs import Skeleton, read_name, split_side

SIDES = {0: "", 1: ".L", 2: ".R"}

BONES = {
    # Rigify and Blender
    "DEF-upper_arm.L": "Upper Arm.L",
    "DEF-forearm.L.001": "Forearm.L",
    "ORG-shin.R": "Shin.R",
    "DEF-f_index.01.L": "Finger.L",
    "DEF-palm.02.R": "Hand.R",
    "DEF-spine.003": "Spine",
    "DEF-pelvis.L": "Hips.L",
    "DEF-ear.R.002": "Ear.R",
    "Thigh_L": "Thigh.L",
    # Mixamo
    "mixamorig:Hips": "Hips",
    "mixamorig:LeftUpLeg": "Thigh.L",
    "mixamorig:RightForeArm": "Forearm.R",
    "mixamorig:LeftHandThumb1": "Thumb.L",
    "mixamorig1:RightToeBase": "Toes.R",
    "mixamorig:HeadTop_End": "Head",
    # VRM
    "J_Bip_L_UpperArm": "Upper Arm.L",
    "J_Bip_R_LowerLeg": "Shin.R",
    "J_Bip_C_UpperChest": "Chest",
    "J_Bip_L_Index2": "Finger.L",
    "J_Sec_Hair1_01": "Hair",
    # Unreal Engine 4 and 5
    "upperarm_l": "Upper Arm.L",
    "lowerarm_twist_01_r": "Forearm.R",
    "calf_l": "Shin.L",
    "ball_r": "Toes.R",
    "spine_05": "Spine",
    "clavicle_l": "Shoulder.L",
    "neck_02": "Neck",
    "index_metacarpal_l": "Hand.L",
    # Auto-Rig Pro
    "forearm_stretch.l": "Forearm.L",
    "thigh_twist.r": "Thigh.R",
    "spine_02.x": "Spine",
    "c_index1.l": "Finger.L",
    "toes_01.r": "Toes.R",
    # MakeHuman: default and game engine
    "upperleg02.L": "Thigh.L",
    "metacarpal3.R": "Hand.R",
    "orbicularis03.L": "Eye.L",
    "toe2-1.R": "Toes.R",
    "finger5-3.L": "Finger.L",
    "lowerarm_l": "Forearm.L",
    "Pelvis": "Hips",
    # Daz, Character Creator, Biped, Source, Unity
    "lShldrBend": "Upper Arm.L",
    "rThighTwist": "Thigh.R",
    "abdomenLower": "Abdomen",
    "CC_Base_L_Forearm": "Forearm.L",
    "CC_Base_NeckTwist01": "Neck",
    "Bip01 R Calf": "Shin.R",
    "ValveBiped.Bip01_L_UpperArm": "Upper Arm.L",
    "Left Upper Leg": "Thigh.L",
    "RightIndexProximal": "Finger.R",
    "UpperChest": "Chest",
    # animals and toys
    "FrontUpperLeg.L": "Upper Foreleg.L",
    "BackLowLeg.R": "Lower Hind Leg.R",
    "l-frontleg001": "Foreleg.L",
    "Tail7": "Tail",
    "Neck2": "Neck",
    "handslot.l": "Held Item.L",
    "Skeleton_torso_joint_1": "Torso",
    "leftarm": "Arm.L",
    "UpperArmR": "Upper Arm.R",
}


@pytest.mark.parametrize("bone", BONES)
def test_bones_of_common_rigs(bone):
    named = read_name(bone)
    assert named.name + SIDES[named.side] == BONES[bone]
    assert named.known


@pytest.mark.parametrize(
    ("bone", "expected"),
    [
        ("Bone.001", "Bone 1"),
        ("Bone", "Bone"),
        ("xyzzy_07_l", "Xyzzy 7.L"),
        ("MyPropellerBlade", "My Propeller Blade"),
        ("right", "Right"),
        ("骨", "骨"),
        ("...", "..."),
    ],
)
def test_unknown_names_are_cleaned_and_kept(bone, expected):
    named = read_name(bone)
    assert named.name + SIDES[named.side] == expected
    assert not named.known


def names(parent_of):
    skeleton = Skeleton.of(parent_of)
    return {bone: named.name for bone, named in zip(skeleton.bones, skeleton.names, strict=True)}


def test_a_bone_named_as_its_limb_is_the_part_that_is_missing():
    mixamo = {"LeftUpLeg": None, "LeftLeg": "LeftUpLeg", "LeftFoot": "LeftLeg"}
    assert names(mixamo) == {"LeftUpLeg": "Thigh", "LeftLeg": "Shin", "LeftFoot": "Foot"}
    toon = {"Left leg": None, "Left knee": "Left leg", "Left ankle": "Left knee"}
    assert names(toon) == {"Left leg": "Thigh", "Left knee": "Shin", "Left ankle": "Foot"}
    arm = {"LeftArm": None, "LeftForeArm": "LeftArm", "LeftHand": "LeftForeArm"}
    assert names(arm) == {"LeftArm": "Upper Arm", "LeftForeArm": "Forearm", "LeftHand": "Hand"}
    joints = {"Hip_L": None, "Knee_L": "Hip_L", "Clavicle_L": None, "Shoulder_L": "Clavicle_L", "Elbow_L": "Shoulder_L"}
    assert list(names(joints).values()) == ["Thigh", "Shin", "Shoulder", "Upper Arm", "Forearm"]
    assert names({"body": None, "leg_L": "body"}) == {"body": "Torso", "leg_L": "Leg"}


def test_bones_may_come_in_any_order():
    skeleton = Skeleton.of({"hand.L": "arm.L", "arm.L": "root", "root": None, "hat": "gone"})
    assert all(parent < bone for bone, parent in enumerate(skeleton.parents))


def test_a_circle_of_parents_is_refused():
    with pytest.raises(ValueError, match=r'"[ab]" is its own parent'):
        Skeleton.of({"a": "b", "b": "a"})


def pairs(*bones):
    skeleton = Skeleton.of(dict.fromkeys(bones))
    return {skeleton.bones[left]: skeleton.bones[right] for left, right in skeleton.mirrored().items()}


def test_pairs():
    assert pairs("arm.L", "arm.R", "head") == {"arm.L": "arm.R"}
    assert pairs("arm.L", "leg.R") == {}


def test_pairs_that_are_numbered_in_opposite_order():
    skeleton = Skeleton.of({"arm_L_2": None, "arm_L_1": "arm_L_2", "arm_R_1": None, "arm_R_2": "arm_R_1"})
    found = {skeleton.bones[left]: skeleton.bones[right] for left, right in skeleton.mirrored().items()}
    assert found == {"arm_L_2": "arm_R_1", "arm_L_1": "arm_R_2"}


@pytest.mark.parametrize(
    ("name", "text", "side"),
    [
        ("upper_arm.L", "upper_arm", 1),
        ("Left Arm", "Arm", 1),
        ("RightHand", "Hand", 2),
        ("arm_r_cloth", "arm_cloth", 2),
        ("Wool sweater", "Wool sweater", 0),
        ("Leather", "Leather", 0),
        ("R", "R", 0),
        ("Glove.R.001", "Glove.001", 2),
    ],
)
def test_names_of_the_artist_keep_their_form(name, text, side):
    assert split_side(name) == (text, side)
