"""Which mesh objects are one character."""

import pytest
from boxes import box
from builders import (
    limbed,
    rig,
)

from wks_segment.blender.errors import UserError
from wks_segment.blender.scene.characters import group, mesh_objects

pytestmark = pytest.mark.usefixtures("scene")


def test_objects_on_one_armature_are_one_character():
    body, hat, other = limbed("Body"), limbed("Hat"), limbed("Other")
    rig([body, hat], "Skeleton")
    characters = group([body, hat, other])
    assert [(character.name, len(character.objects)) for character in characters] == [("Skeleton", 2), ("Other", 1)]


def test_object_on_a_bone_belongs_to_the_armature():
    body, hat = limbed("Body"), limbed("Hat")
    armature = rig([body], "Skeleton")
    hat.parent, hat.parent_type, hat.parent_bone = armature, "BONE", "limb"
    assert [character.objects for character in group([body, hat])] == [(body, hat)]


def test_bone_shapes_are_no_characters():
    body, shape = limbed("Body"), box(name="Widget")
    armature = rig([body])
    armature.pose.bones["limb"].custom_shape = shape
    assert mesh_objects([shape, armature, body]) == [body]


def test_no_object_is_refused():
    with pytest.raises(UserError, match="select the character's mesh"):
        group([])
