"""The tree of bones in the panel."""

from types import SimpleNamespace

import bpy
import pytest
from builders import limbed, limbed_rigged, select

from wks_segment.blender.ui.teach_panel import WKS_SEGMENT_UL_bones
from wks_segment.blender.workflow import bone_list
from wks_segment.rigs import BoneRow, BoneTree, Skeleton

pytestmark = pytest.mark.usefixtures("scene")
HUMAN = ("hips", "spine", "head", "upper_arm", "forearm", "hand", "finger")


def human():
    """A tree of rows: a trunk, and arms with fingers on both sides."""
    parent = {"hips": -1, "spine": 0, "head": 1, "upper_arm": 1, "forearm": 3, "hand": 4, "finger": 5}
    name = {"hips": "Hips", "spine": "Spine", "head": "Head", "upper_arm": "Upper Arm", "forearm": "Forearm",
            "hand": "Hand", "finger": "Finger"}  # fmt: skip
    area = {"hips": 0.2, "spine": 0.3, "head": 0.1, "upper_arm": 0.15, "forearm": 0.12, "hand": 0.08, "finger": 0.05}
    skeleton = Skeleton.of(dict.fromkeys(HUMAN))
    rows = tuple(
        BoneRow(name[bone], True, (i,), (1, 2) if i > 2 else (0,), parent[bone], area[bone])
        for i, bone in enumerate(HUMAN)
    )
    return BoneTree(skeleton, rows, None, None, None)


def chosen(settings):
    return [item.name for item in settings.bones if item.own]


def shown(settings):
    flags, _ = WKS_SEGMENT_UL_bones.filter_items(SimpleNamespace(bitflag_filter_item=1), None, settings, "bones")
    return [item.name for item, flag in zip(settings.bones, flags, strict=True) if flag]


def test_the_list_follows_the_number(settings):
    bone_list.fill(settings, human())
    assert chosen(settings) == ["Hips", "Spine", "Head", "Upper Arm", "Forearm", "Hand"]
    settings.usual_parts = False
    settings.bone_parts = 3
    assert len(chosen(settings)) == 3
    settings.bone_parts = 7
    assert chosen(settings) == [item.name for item in settings.bones]


def test_a_choice_of_the_user_sets_the_number(settings):
    bone_list.fill(settings, human())
    settings.bones[5].own = False
    assert not settings.usual_parts
    assert settings.bone_parts == 5
    assert "Hand" not in chosen(settings)
    bone_list.fill(settings, human())
    assert "Hand" not in chosen(settings), "the same rig keeps the choice"
    (own,), _ = bone_list.own_rows([human()], settings)
    assert own == {0, 1, 2, 3, 4}


def test_rows_below_closed_ones_are_hidden(settings):
    bone_list.fill(settings, human())
    assert shown(settings) == ["Hips", "Spine", "Head", "Upper Arm"]
    settings.bones[3].open = True
    assert shown(settings) == ["Hips", "Spine", "Head", "Upper Arm", "Forearm"]
    settings.bones[0].open = False
    assert shown(settings) == ["Hips"]


def test_another_rig_gets_the_names_of_the_first(settings):
    settings.usual_parts, settings.bone_parts = False, 4
    other = human()
    renamed = Skeleton.of(dict.fromkeys(f"DEF-{bone}" for bone in HUMAN))
    trees = [human(), BoneTree(renamed, other.rows, None, None, None)]
    own, names = bone_list.own_rows(trees, settings)
    assert {trees[0].rows[row].name for row in own[0]} == set(names[1])
    assert len(own[1]) == 4


def test_bones_are_listed(settings):
    select(limbed_rigged())
    assert bpy.ops.wks_segment.list_bones() == {"FINISHED"}
    assert [(item.name, item.depth) for item in settings.bones] == [("Torso", 0), ("Limb", 1)]
    select(limbed("Alone"))
    with pytest.raises(RuntimeError, match='"Alone" has no armature'):
        bpy.ops.wks_segment.list_bones()
    assert len(settings.bones) == 2


def test_listing_bones_is_undone(settings):
    select(limbed_rigged())
    bpy.ops.ed.undo_push(message="before")
    bpy.ops.wks_segment.list_bones()
    bpy.ops.ed.undo_push(message="listed")
    assert len(bpy.context.scene.wks_segment.bones) == 2
    bpy.ops.ed.undo()
    assert len(bpy.context.scene.wks_segment.bones) == 0
