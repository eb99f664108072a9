"""Parts from bones: a figure of boxes in a row, each of them moved by one bone."""

import numpy as np
import pytest

from wks_segment.rigs import (
    STANDARD,
    BoneTree,
    Skeleton,
    Skin,
    parts_of_faces,
    rows_by_names,
    rows_by_number,
    usual_rows,
)

HUMAN = {
    "root": None, "hips": "root", "spine": "hips", "chest": "spine", "neck": "chest", "head": "neck", "jaw": "head",
    **{f"{bone}.{side}": f"{above}.{side}" if above != "chest" and above != "hips" else above
       for side in "LR"
       for bone, above in (("upper_arm", "chest"), ("forearm", "upper_arm"), ("hand", "forearm"), ("f_index", "hand"),
                           ("thigh", "hips"), ("shin", "thigh"), ("foot", "shin"), ("ik_foot", "root"))},
}  # fmt: skip
AREAS = {
    "hips": 8, "spine": 8, "chest": 10, "neck": 2, "head": 8, "jaw": 1,
    "upper_arm": 4, "forearm": 3, "hand": 2, "f_index": 1, "thigh": 8, "shin": 6, "foot": 3,
}  # fmt: skip


def skin_of(skeleton, areas, touching=()):
    """Faces of the wanted number for each bone, all apart, and one between each two bones that touch."""
    faces, weights = [], []
    corners = 0
    for bone, count in enumerate(areas):
        for _ in range(count):
            faces.append([corners, corners + 1, corners + 2])
            corners += 3
            weights += [bone] * 3
    points = np.random.default_rng(0).random((corners, 3))
    points[0::3] = points[0::3] + 10 * np.arange(corners // 3)[:, None]
    points[1::3] = points[0::3] + [1, 0, 0]
    points[2::3] = points[0::3] + [0, 1, 0]
    first = {bone: weights.index(bone) for bone in set(weights)}
    for a, b in touching:
        points[first[a]] = points[first[b] + 1]
    table = np.zeros((corners, len(areas)))
    table[np.arange(corners), weights] = 1
    return Skin(points, (np.arange(corners), np.repeat(np.arange(len(faces)), 3)), np.ones(len(faces)), table)


def tree_of(parent_of, area_of, touching=()):
    skeleton = Skeleton.of(parent_of)
    areas = [area_of.get(bone, area_of.get(bone.removesuffix(".L").removesuffix(".R"), 0)) for bone in skeleton.bones]
    at = skeleton.bones.index
    return BoneTree.of(skeleton, skin_of(skeleton, areas, [(at(a), at(b)) for a, b in touching]))


def parts(tree, number, sides=True):
    found = parts_of_faces([tree], [rows_by_number(tree.rows, number)], sides)
    return [part.full_name for part in found.parts]


def test_both_sides_of_a_pair_are_one_row():
    tree = tree_of(HUMAN, AREAS)
    assert [row.name for row in tree.rows if row.is_pair] == [
        "Upper Arm", "Forearm", "Hand", "Finger", "Thigh", "Shin", "Foot",
    ]  # fmt: skip
    assert tree.named_area() == pytest.approx(1)


def test_fingers_join_the_hand_and_the_jaw_the_head_first():
    assert parts(tree_of(HUMAN, AREAS), 11) == [
        "Hips", "Spine", "Chest", "Neck", "Head", "Upper Arm.L", "Upper Arm.R", "Forearm.L", "Forearm.R", "Hand.L",
        "Hand.R", "Thigh.L", "Thigh.R", "Shin.L", "Shin.R", "Foot.L", "Foot.R",
    ]  # fmt: skip


def test_bones_of_the_spine_become_the_torso():
    assert parts(tree_of(HUMAN, AREAS), 8, sides=False) == [
        "Torso", "Head", "Upper Arm", "Forearm", "Hand", "Thigh", "Shin", "Foot",
    ]  # fmt: skip


@pytest.mark.parametrize("number", [1, 2, 5, 9, 13, 40])
def test_numbers_have_no_gap_and_count_pairs_once(number):
    tree = tree_of(HUMAN, AREAS)
    own = rows_by_number(tree.rows, number)
    assert len(own) == min(number, len(tree.rows))
    found = parts_of_faces([tree], [own])
    assert np.unique(found.labels[0]).tolist() == list(range(len(found.parts)))
    assert len(set(found.parts)) == len(found.parts)
    one = parts_of_faces([tree], [own], sides=False)
    assert len(one.parts) == len(own)


def test_parts_with_standard_names():
    tree = tree_of(HUMAN, AREAS)
    own, names = usual_rows(tree.rows)
    found = parts_of_faces([tree], [own], names=[names])
    assert {part.name for part in found.parts} == {
        "Torso", "Hips", "Neck", "Head", "Upper Arm", "Forearm", "Hand", "Thigh", "Shin", "Foot",
    }  # fmt: skip


def test_two_rigs_share_their_parts():
    other = {"mixamorig:Hips": None, "mixamorig:Head": "mixamorig:Hips", "Tail1": "mixamorig:Hips"}
    trees = [tree_of(HUMAN, AREAS), tree_of(other, {"mixamorig:Hips": 5, "mixamorig:Head": 3, "Tail1": 2})]
    found = parts_of_faces(trees, [rows_by_names(tree.rows, STANDARD) for tree in trees], names=[STANDARD] * 2)
    names = [part.full_name for part in found.parts]
    assert names[-1] == "Tail"
    assert {names[i] for i in np.unique(found.labels[1])} == {"Hips", "Head", "Tail"}


def test_a_foot_that_hangs_on_the_root_belongs_to_the_leg_that_it_touches():
    rig = {"root": None, "body": "root", "thigh.L": "body", "foot.L": "root", "thigh.R": "body", "foot.R": "root"}
    areas = {"body": 10, "thigh": 4, "foot": 2}
    tree = tree_of(rig, areas, [("foot.L", "thigh.L"), ("foot.R", "thigh.R"), ("thigh.L", "body"), ("thigh.R", "body")])
    assert parts(tree, 2) == ["Torso", "Leg.L", "Leg.R"]


def test_a_foot_that_touches_nothing_belongs_to_the_shin():
    rig = {**HUMAN, "foot.L": "root", "foot.R": "root"}
    tree = tree_of(rig, AREAS)
    foot = next(row for row in tree.rows if row.name == "Foot")
    assert tree.rows[foot.parent].name == "Shin"


def test_numbered_bones_of_no_known_name():
    rig = {f"Bone.{i:03}": None if i == 0 else f"Bone.{i - 1:03}" for i in range(300)}
    tree = tree_of(rig, dict.fromkeys(rig, 1))
    found = parts_of_faces([tree], [rows_by_number(tree.rows, 8)])
    assert len(found.parts) == 8
    assert len({part.full_name for part in found.parts}) == 8
    assert all(part.name.startswith("Bone ") for part in found.parts)
    assert np.bincount(found.labels[0]).min() >= 1


def test_faces_without_weights_have_no_part():
    skeleton = Skeleton.of({"body": None, "head": "body"})
    skin = skin_of(skeleton, [4, 4])
    skin.weights[6:12] = 0
    tree = BoneTree.of(skeleton, skin)
    labels = parts_of_faces([tree], [rows_by_number(tree.rows, 2)]).labels[0]
    assert labels.tolist() == [0, 0, -1, -1, 1, 1, 1, 1]


def test_a_tiny_root_is_one_with_what_hangs_on_it():
    tree = tree_of({"root": None, "body": "root", "head": "body"}, {"root": 1, "body": 400, "head": 100})
    assert [row.name for row in tree.rows] == ["Torso", "Head"]
    assert [len(row.bones) for row in tree.rows] == [2, 1]


@pytest.mark.parametrize(
    ("parent_of", "areas", "message"),
    [
        ({}, [], "there is no bone"),
        ({"a": None, "b": "a"}, [0, 0], "none of the 2 bones has weights"),
        ({"a": None, "b": "a"}, [3, 0], 'only the bone "a" moves the mesh'),
    ],
)
def test_rigs_without_parts_are_refused(parent_of, areas, message):
    skeleton = Skeleton.of(parent_of)
    skin = skin_of(skeleton, areas)
    if not any(areas):
        skin = Skin.of_triangles(np.eye(3), np.array([[0, 1, 2]]), np.zeros((3, len(areas))))
    with pytest.raises(ValueError, match=message):
        BoneTree.of(skeleton, skin)


def test_weights_of_another_mesh_are_refused():
    with pytest.raises(ValueError, match="weights of 2 vertices, but the mesh has 3"):
        Skin.of_triangles(np.eye(3), np.array([[0, 1, 2]]), np.zeros((2, 1)))
