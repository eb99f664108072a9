"""The bones of a character, as its parts."""

from pathlib import Path

import bpy
import numpy as np
import pytest
from builders import limbed, limbed_rigged, mesh_object, rig

from wks_segment.blender.errors import UserError
from wks_segment.blender.scene.bone_weights import bone_tree_of
from wks_segment.blender.scene.characters import Character, group, mesh_objects
from wks_segment.blender.scene.file_formats import open_files
from wks_segment.rigs import parts_of_faces, usual_rows

pytestmark = pytest.mark.usefixtures("scene")


DATA = Path(__file__).resolve().parents[4] / "shared" / "data"
RIGGED = [path for folder in ("characters", "rigged") for path in sorted((DATA / folder).glob("*.*"))]
PERSON = {"Head", "Neck", "Torso", "Hips", "Upper Arm", "Forearm", "Hand", "Thigh", "Shin", "Foot"}
BEAST = {
    "Head", "Neck", "Torso", "Tail", "Upper Foreleg", "Lower Foreleg", "Forepaw", "Upper Hind Leg", "Lower Hind Leg",
    "Hind Paw",
}  # fmt: skip
USUAL = {
    "Casual": PERSON, "King": PERSON, "Voxel": PERSON, "Fox": BEAST | {"Ear"}, "Wolf": BEAST, "Cow": BEAST,
    "Horse": BEAST | {"Ear"}, "Trex": BEAST, "Stegosaurus": BEAST,
    "Cat": {"Head", "Torso", "Tail", "Foreleg", "Hind Leg"},
}  # fmt: skip
"""The usual parts of files whose names of bones tell them."""


def tree_of(*objects):
    return bone_tree_of(Character(objects))


def test_bones_of_a_rigged_mesh():
    obj = limbed_rigged()
    tree = tree_of(obj)
    assert [(row.name, row.parent) for row in tree.rows] == [("Torso", -1), ("Limb", 0)]
    centers = np.array([polygon.center for polygon in obj.data.polygons])
    assert (tree.row_of_faces == (centers[:, 0] > 1.3)).mean() > 0.97
    assert sum(row.area for row in tree.rows) == pytest.approx(1)


def test_an_object_on_a_bone_belongs_to_it():
    body = limbed("Body")
    armature = rig([body])
    hat = mesh_object([(0, 0, 5), (1, 0, 5), (0, 1, 5)], [(0, 1, 2)], "Hat")
    hat.parent, hat.parent_type, hat.parent_bone = armature, "BONE", "limb"
    tree = tree_of(body, hat)
    assert tree.rows[tree.row_of_faces[-1]].name == "Limb"


def test_faces_without_weights_have_no_bone():
    obj = limbed_rigged()
    half = [vertex.index for vertex in obj.data.vertices if vertex.co.z < 0]
    for vertex_group in obj.vertex_groups:
        vertex_group.remove(half)
    tree = tree_of(obj)
    assert 0.3 < (tree.row_of_faces < 0).mean() < 0.6


def test_bones_that_do_not_deform_are_left_out():
    obj = limbed_rigged()
    bpy.data.objects["Rig"].data.bones["limb"].use_deform = False
    with pytest.raises(UserError, match='"Walker": only the bone "root" moves the mesh'):
        tree_of(obj)


def test_rigs_that_cannot_be_used_are_refused():
    with pytest.raises(UserError, match='"Alone" has no armature: select a rigged mesh'):
        tree_of(limbed("Alone"))
    obj = limbed_rigged()
    obj.vertex_groups.clear()
    with pytest.raises(UserError, match='"Walker": none of the 2 bones has weights on the mesh: weight the mesh first'):
        tree_of(obj)


@pytest.mark.skipif(not RIGGED, reason="the characters to develop on are not here")
@pytest.mark.parametrize("path", [path for path in RIGGED if path.suffix != ".blend"], ids=lambda path: path.stem)
def test_bones_of_public_rigs_have_names(path):
    meshes = [obj for obj in mesh_objects(open_files([path])[0]) if obj.name in bpy.context.view_layer.objects]
    tree = bone_tree_of(group(meshes, together=True)[0])
    assert tree.named_area() >= 0.95
    own, names = usual_rows(tree.rows)
    found = parts_of_faces([tree], [own], names=[names])
    assert np.mean(found.labels[0] < 0) < 0.01
    if path.stem in USUAL:
        assert {part.name for part in found.parts} == USUAL[path.stem]
