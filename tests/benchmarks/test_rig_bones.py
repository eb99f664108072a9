"""Which bone a face belongs to: names of sides, and small bones."""

import numpy as np
import pytest

from benchmarks.rig_bones import Bones, truth, without_side


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("Arm.L", "Arm"),
        ("hand_r", "hand"),
        ("Left leg", "leg"),
        ("l-frontleg", "frontleg"),
        ("mixamorig:LeftUpLeg", "mixamorig:UpLeg"),
        ("Knight_ArmRight", "Knight_Arm"),
        ("UpperLegR", "UpperLeg"),
        ("R_Foot", "Foot"),
        ("Shoulder", "Shoulder"),
        ("IKBackLeg", "IKBackLeg"),
        ("Leftover", "Leftover"),
        ("right", "right"),
    ],
)
def test_names_without_their_side(name, expected):
    assert without_side(name) == expected


BODY = {"root": None, "arm.L": "root", "hand.L": "arm.L", "arm.R": "root", "hand.R": "arm.R"}


def test_parents_come_first():
    bones = Bones.of(dict(reversed(BODY.items())))
    assert all(parent < i for i, parent in enumerate(bones.parents))


def test_left_and_right_are_one_bone():
    bones = Bones.of(BODY)
    faces = np.arange(5)
    bone, names = truth(bones, faces, np.ones(5))
    assert names == ["root", "arm", "hand"]
    assert bone.tolist() == [0, 1, 2, 1, 2]


def test_sides_that_are_numbered_in_opposite_order():
    rig = {"root": None, "arm_L_2": "root", "arm_L_1": "arm_L_2", "arm_R_1": "root", "arm_R_2": "arm_R_1"}
    bone, _ = truth(Bones.of(rig), np.arange(5), np.ones(5))
    assert bone.tolist() == [0, 1, 2, 1, 2]


def test_small_bones_count_as_their_parents_upward():
    bones = Bones.of({"root": None, "arm": "root", "hand": "arm", "finger": "hand"})
    bone, names = truth(bones, np.array([0, 1, 2, 3]), np.array([1.0, 0.5, 0.005, 0.005]))
    assert names == ["root", "arm"]
    assert bone.tolist() == [0, 1, 1, 1]


def test_small_bones_together_can_be_large_enough():
    bones = Bones.of({"root": None, "hand": "root", "thumb": "hand", "finger": "hand"})
    bone, names = truth(bones, np.array([0, 1, 2, 3]), np.array([1.0, 0.006, 0.006, 0.006]))
    assert names == ["root", "hand"]
    assert bone.tolist() == [0, 1, 1, 1]
